"""One step of the classical Runge-Kutta method, and one sample interval made of such steps."""

from armid.simulation.template.locate import cut_text
from armid.simulation.template.parts import Parts, each, listed, target

STEP = '''
@{kind}
def step{suffix}(time, h, {latches}{x}{k1s}{um}{ub}{fixed}):
    half = 0.5 * h
    {y1}
    {k2} = rates{suffix}(time + half, {latches}{y}{um}{fixed})
    {y2}
    {k3} = rates{suffix}(time + half, {latches}{y}{um}{fixed})
    {y3}
    {k4} = rates{suffix}(time + h, {latches}{y}{ub}{fixed})
    sixth = h * (1.0 / 6.0)
    return {result}
'''

APART = '''
# The same functions apart: what is rarely called must not swell the loop, nor the time to compile it.
rates_apart, guards_apart = shared(rates.py_func), shared(guards.py_func)
'''

ADVANCE = '''
@{kind}
def advance{suffix}(start, interval, substeps, {latches}{times}{x}{ga}{u0}{u1}{fixed}):
    """Carry the states over one sample interval; cut steps at kinks."""
    h = {lanes_or_number}(interval / substeps)
    for j in range(substeps):
        time = start + j * h
        {inputs_step}
        {guards_again}
        {k1} = rates{suffix}(time, {latches}{x}{ua}{fixed})
        {b} = step{suffix}(time, h, {latches}{x}{k1s}{um}{ub}{fixed})
        {cut}
        {advance}
    return {advanced}
'''

INPUTS = (
    "ua_@ = u0_@ + (u1_@ - u0_@) * (j / substeps); ub_@ = u0_@ + (u1_@ - u0_@) * ((j + 1) / substeps); "
    "um_@ = 0.5 * (ua_@ + ub_@)"
)


def step_text(parts: Parts) -> str:
    """Return `step`, written into the loop, and with guards `step_apart`, a function of its own."""
    x = parts.states
    result = "".join(f"{n} + sixth * (k1_{n} + 2.0 * (k2_{n} + k3_{n}) + k4_{n}), " for n in x)
    lines = {
        "y1": each(x, "y_@ = @ + half * k1_@", 4), "y2": each(x, "y_@ = @ + half * k2_@", 4),
        "y3": each(x, "y_@ = @ + h * k3_@", 4), "result": f"({result})",
    }  # fmt: skip
    text = STEP.format(**parts.lists, **lines, kind="compiled", suffix="")
    if parts.all_guards:
        text += APART + STEP.format(**parts.lists, **lines, kind="shared", suffix="_apart")
    return text


def evaluate_guards(parts: Parts, time: str, suffix: str = "") -> str:
    """Return the line that evaluates the guards at the start of a step."""
    state = listed("", parts.latches) + listed("", parts.states)
    arguments = f"{time}, {state}{listed('ua_', parts.inputs)}{listed('', parts.fixed)}"
    return f"{target('ga_', parts.all_guards)} = guards{suffix}({arguments})"


def advance_text(parts: Parts) -> str:
    """Return `advance`, written into the loop, and `advance_apart`, a function of its own for the finer steps."""
    text = advance_one(parts, "compiled", "", "float")
    return text + "\n\n" + advance_one(parts, "shared", "_apart", "splat") if parts.latches else text


def advance_one(parts: Parts, kind: str, suffix: str, number: str) -> str:
    """Return one of the two."""
    jumping = bool(parts.guards) and parts.guards_use_inputs
    text = ADVANCE.format(
        **parts.lists, kind=kind, suffix=suffix, lanes_or_number=number,
        inputs_step=each(parts.inputs, INPUTS, 8),
        guards_again=evaluate_guards(parts, "time", suffix) if jumping else "pass",
        cut=cut_text(parts, suffix) if parts.all_guards else "pass",
        advance=each(parts.states, "@ = b_@", 8), advanced=f"({listed('', parts.carried)})",
    )  # fmt: skip
    return text.strip()
