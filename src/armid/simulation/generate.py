"""The text of the generated module: the composed equations and the loop that integrates them.

Classical fourth-order Runge-Kutta on lanes of candidates, a fixed number of steps between samples. Where a guard
changes its sign inside a step, the step is cut there: a quadratic through the guard at both ends and in the middle
(cubic Hermite of the states) gives the instant. Only lanes with a change take the cut, so a candidate's result does
not depend on its neighbours.
"""

from armid.model import Model
from armid.simulation.source import SourceText
from armid.simulation.template import module_text

INDENT = "    "


def parenthesised(items: list[str]) -> str:
    """Return a tuple expression."""
    return f"({', '.join(items)}{',' if len(items) == 1 else ''})"


def variable(key: str) -> str:
    """Return the local name of a key; the prefix keeps a plant's `g` or `h` apart from the loop's own names."""
    return f"v_{key.replace('.', '__')}"


class Emitter:
    """Write the parts of one model's module; public lists hold local names, private ones keys of the graph."""

    def __init__(self, model: Model) -> None:
        self.model, self.graph = model, model.graph
        self.sources = SourceText()
        self.called: set[str] = set()
        self.states = [variable(k) for k in model.states]
        self.latches = [variable(k) for k in model.latches]
        self.inputs = [variable(i.name) for i in model.plant.inputs]
        self.parameters = [variable(k) for k in model.parameters]
        self.constants = [variable(k) for k in model.constants]
        keys = [k.replace(".", "__") for k in model.states]
        latch_keys = [k.replace(".", "__") for k in model.latches]
        self._rates, self._initials = [f"rate__{k}" for k in keys], [f"initial__{k}" for k in keys]
        kinks = [n.key for n in self.graph.of_kind("guard") if n.key.removeprefix("guard__") not in latch_keys]
        self._guards = [*(f"guard__{k}" for k in latch_keys), *kinks]
        self.latch_guards = [variable(k) for k in self._guards[: len(latch_keys)]]
        self.guards = [variable(k) for k in kinks]
        self._output = model.plant.output
        self._fixed = self._fixed_keys([*self._rates, *self._guards, self._output])
        self.fixed = [variable(k) for k in self._fixed]

    @property
    def guards_use_inputs(self) -> bool:
        """Tell whether a guard may jump with an input, or with time, at a sample."""
        return self._uses(self._guards, [i.name for i in self.model.plant.inputs])

    def _uses(self, keys: list[str], wanted: list[str]) -> bool:
        return any(k in wanted or self._uses(list(self.graph.nodes[k].needs), wanted) for k in keys)

    def _fixed_keys(self, moving: list[str]) -> list[str]:
        """Keys that do not move, which the moving equations use."""
        needed = {k for n in self.graph.order(moving) if not self.graph.is_static(n.key) for k in n.needs}
        return [k for k in self.graph.nodes if k in needed and self.graph.is_static(k) and self._valued(k)]

    def _valued(self, key: str) -> bool:
        """Tell whether a node is more than an empty port."""
        return not (self.graph.nodes[key].kind == "port" and not self.graph.nodes[key].terms)

    def assignments(self, wanted: list[str], static: bool) -> list[str]:
        """Return one line for each node that leads to the wanted ones."""
        return [f"{variable(n.key)} = {self.expression(n.key)}" for n in self.graph.order(wanted)
                if self.graph.is_static(n.key) == static or n.kind == "initial" or not self._valued(n.key)]  # fmt: skip

    def expression(self, key: str) -> str:
        """Return the right-hand side of a node."""
        node = self.graph.nodes[key]
        if node.kind == "port":
            return " + ".join(map(variable, node.terms)) or "0.0"
        assert node.function is not None
        name = f"f__{key}"
        self.called.add(name)
        if name not in self.sources.texts:
            self.sources.add(name, node.function)
        return f"{name}({', '.join(f'{argument}={variable(bound)}' for argument, bound in node.arguments)})"

    def function(self, name: str, arguments: list[str], lines: list[str], result: list[str]) -> str:
        """Return a compiled function that evaluates lines and returns a tuple."""
        body = "\n".join(INDENT + line for line in [*lines, f"return {parenthesised(result)}"])
        return f"@compiled\ndef {name}({', '.join(arguments)}):\n{body}\n"

    def equations(self) -> str:
        """Return every function that evaluates the composed equations."""
        moving = [variable("time"), *self.latches, *self.states, *self.inputs, *self.fixed]
        given = [*self.parameters, *self.constants]
        starts, rates, guards = ([variable(k) for k in keys] for keys in (self._initials, self._rates, self._guards))
        parts = [
            self.function("fixed_values", given, self.assignments(self._fixed, True), [f"1.0 * {k}" for k in self.fixed]),
            self.function("start_values", given, self.assignments(self._initials, True), starts),
            self.function("rates", moving, self.assignments(self._rates, False), rates),
            self.function("guards", moving, self.assignments(self._guards, False), guards),
            self.function("recorded", moving, self.assignments([self._output], False), [variable(self._output)]),
        ]
        return self.function_texts() + "\n\n".join(parts)

    def function_texts(self) -> str:
        """Return the plain functions of plant and effects, those with control flow wrapped lane by lane."""
        texts = []
        for name, text in self.sources.texts.items():
            if name in self.sources.by_lane & self.called:
                texts.append(by_lane(name, text))
            else:
                texts.append(f"@compiled\n{text}\n")
        return "\n\n".join(texts) + "\n\n\n"


def by_lane(name: str, text: str) -> str:
    """Return a function with control flow, called once for each lane."""
    arguments = text[text.index("(") + 1 : text.index(")")]
    names = [a.split("=")[0].strip() for a in arguments.split(",") if a.strip()]
    lanes = ", ".join(f"lane({a}, i)" for a in names)
    scalar = text.replace(f"def {name}(", f"def {name}__scalar(", 1)
    return (
        f"@compiled\n{scalar}\n\n@compiled\ndef {name}({arguments}):\n"
        f"    result = splat(0.0)\n    for i in range(WIDTH):\n"
        f"        result = with_lane(result, i, {name}__scalar({lanes}))\n    return result\n"
    )


def generate_module(model: Model, width: int) -> str:
    """Return the self-contained text of the module that simulates a model, `width` candidates side by side."""
    emitter = Emitter(model)
    equations = emitter.equations()
    return module_text(emitter, equations, width)
