"""The face towards pymoo: space, meter, fitness, problem."""
