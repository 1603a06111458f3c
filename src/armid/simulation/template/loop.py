"""The loop over groups of candidates and over samples."""

from armid.simulation.template.calm import calm_parts
from armid.simulation.template.parts import Parts, block, each, listed, target
from armid.simulation.template.step import advance_text, evaluate_guards

LOOP = '''
@shared
def flush(block, output, places, first, count):
    """Copy samples from lanes to the rows of the candidates; a lane of the padding has no place."""
    for row in range(WIDTH):
        place = places[row]
        if place >= 0:
            for i in range(count):
                output[place, first + i] = block[i * WIDTH + row]


@shared
def keep_states(trace, places, sample, {x}):
    """Copy the states at one sample to the rows of the candidates."""
    for row in range(WIDTH):
        if places[row] >= 0:
            {trace_states}


{advance_functions}


@compiled
def between(z, h, {a}{b}{fas}{fbs}):
    """States at a fraction z of a step (cubic Hermite)."""
    w = z * z * (3.0 - 2.0 * z)
    p = h * z * (1.0 - z) * (1.0 - z)
    q = -h * z * z * (1.0 - z)
    return {hermite}


@numba.njit(error_model="numpy", nogil=True, cache=True)
def simulate(population, n_padded, constants, inputs, interval, n_samples, substeps, refinement, fresh_samples, plan,
             zero_hold, start_time, limit, lane_places, first_group, last_group, output, switch_times, trace):
    block = np.empty(BLOCK * WIDTH)
    for group in range(first_group, last_group):
        g = group * WIDTH
        places = lane_places[g : g + WIDTH]
        {load_parameters}
        {load_constants}
        {fixed_assign}
        {start_assign}
        {latch_start}
        alive = splat(1.0)
        fresh = splat(0.0)
        calm = splat(0.0)
        {y_out} = recorded(start_time, {latches}{x}{ua}{fixed})
        store(block, 0, splat(0.0) + {y_out_value})
        if trace.shape[0] > 0:
            keep_states(trace, places, 0, {x})
        buffered = 1
        flushed = 0
        s = 0
        while s < n_samples - 1:
            span = plan[s]
            time = start_time + s * interval
            small, mixed = True, False
            {calm_block}
            if small:
                {copy_in}
                for i in range(span):
                    now = time + i * interval
                    {inputs_sample}
                    {fine_step}
                    {y_out} = recorded(now + interval, {latches_n}{x_n}{ur}{fixed})
                    {store_output}
                    if trace.shape[0] > 0:
                        keep_states(trace, places, s + i + 1, {x_n})
                {keep_calm}
                {copy_out}
            for i in range(buffered, buffered + span):
                alive = select(limit, abs(load(block, i * WIDTH)), alive, 0.0)
            if any_above(1.0 - alive, 0.5):
                for i in range(buffered, buffered + span):
                    store(block, i * WIDTH, select(alive, 0.5, load(block, i * WIDTH), np.nan))
            buffered += span
            s += span
            if buffered > BLOCK - LONGEST:
                flush(block, output, places, flushed, buffered)
                flushed += buffered
                buffered = 0
                if not any_above(alive, 0.5):
                    break
        flush(block, output, places, flushed, buffered)
        flushed += buffered
        for row in range(WIDTH):
            if places[row] >= 0:
                output[places[row], flushed:] = np.nan
        {store_switches}
'''


def loop_text(parts: Parts) -> str:
    """Return the functions that move results, `advance`, and `simulate`."""
    x = parts.states
    hermite = "".join(f"a_{n} + w * (b_{n} - a_{n}) + p * fa_{n} + q * fb_{n}, " for n in x)
    trace = [f"trace[{i}, places[row], sample] = lane({n}, row)" for i, n in enumerate(x)]
    switches = [f"store(switch_times, {i} * n_padded + g, {t})" for i, t in enumerate(parts.times)]
    return LOOP.format(
        **parts.lists, **start_lines(parts), **calm_parts(parts),
        advance_functions=advance_text(parts), hermite=f"({hermite})", trace_states=block(trace, 12),
        inputs_sample=block(sample_lines(parts), 20), store_switches=block(switches, 8),
        copy_in=each(parts.carried, "n_@ = @", 16), copy_out=each(parts.carried, "@ = n_@", 16),
    )  # fmt: skip


def sample_lines(parts: Parts) -> list[str]:
    """Return the lines that read the inputs: at both ends of a sample interval, and at the sample that ends it.

    A held input jumps at that sample: the motion has not seen its new value, the recorded signal does.
    """
    return [
        f"u0_{n} = inputs[{i}, s + i]; ur_{n} = inputs[{i}, s + i + 1]; u1_{n} = u0_{n} if zero_hold[{i}] else ur_{n}"
        for i, n in enumerate(parts.inputs)
    ]


def start_lines(parts: Parts) -> dict[str, str]:
    """Return the lines that make a group of candidates ready to start."""
    given = listed("", [*parts.parameters, *parts.constants])
    loaded = [f"{n} = load(population, {i} * n_padded + g)" for i, n in enumerate(parts.parameters)]
    constants = [f"{n} = constants[{i}]" for i, n in enumerate(parts.constants)]
    start = [f"{target('', parts.states)} = start_values({given})", *(f"{n} = splat(0.0) + {n}" for n in parts.states)]
    return {
        "load_parameters": block(loaded, 8), "load_constants": block(constants, 8),
        "fixed_assign": f"{target('', parts.fixed)} = fixed_values({given})",
        "start_assign": block(start, 8), "latch_start": block(latch_lines(parts), 8),
    }  # fmt: skip


def latch_lines(parts: Parts) -> list[str]:
    """Return the lines that set latches and guards at the start; a latch may be closed from the start on."""
    lines = [f"{k} = splat(0.0)" for k in parts.latches] + [f"{t} = splat(np.nan)" for t in parts.times]
    lines += [f"ua_{n} = inputs[{i}, 0]" for i, n in enumerate(parts.inputs)]
    if not parts.all_guards:
        return lines
    closed = []
    for k, g, t in zip(parts.latches, parts.latch_guards, parts.times, strict=True):
        closed += [f"{k} = select(falls({k}, ga_{g}), 0.0, 1.0, 0.0)", f"{t} = select({k}, 0.5, start_time, np.nan)"]
    evaluate = evaluate_guards(parts, "start_time")
    return [*lines, evaluate, *closed, evaluate]
