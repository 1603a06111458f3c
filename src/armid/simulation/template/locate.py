"""Where inside a step a guard changes its sign, and the step cut there."""

from armid.simulation.template.parts import Parts, block, each, listed, nested, target

ROOT = '''
@compiled
def root(crossing, start, middle, end):
    """Fraction of the step at which the quadratic through three values is 0; 2 where nothing crosses."""
    a = 2.0 * start - 4.0 * middle + 2.0 * end
    b = 4.0 * middle - 3.0 * start - end
    spread = square_root(np.maximum(b * b - 4.0 * a * start, 0.0))
    fraction = 2.0 * start / (select(start, 0.0, spread, -spread) - b)
    return select(crossing, 0.0, np.minimum(np.maximum(fraction, 0.0), 1.0), 2.0)


@compiled
def falls(latch, end):
    """Positive where a latch that is still open has come to 0 or below."""
    return select(latch, 0.5, -1.0, 1e-300 - end)


@compiled
def crossings({latches}{ga}{gb}):
    return {crossing_tuple}


@shared
def locate(time, h, {latches}{times}{a}{b}{ga}{gb}{ua}{ub}{fixed}):
    done = splat(0.0)
    {c} = crossings({latches}{ga}{gb})
    crossing = {any_crossing}
    for _ in range(MAX_CUTS):
        span = (1.0 - done) * h
        t0 = time + done * h
        {inputs_start}
        {fa} = rates_apart(t0, {latches}{a}{us}{fixed})
        {fb} = rates_apart(time + h, {latches}{b}{ub}{fixed})
        {middle_states}
        {inputs_middle}
        {gm} = guards_apart(t0 + 0.5 * span, {latches}{m}{um}{fixed})
        {roots}
        z = {first_root}
        fraction = select(crossing, 0.0, np.minimum(z, 1.0), 1.0)
        part = span * fraction
        {inputs_cut}
        {d} = step_apart(t0, part, {latches}{a}{fas}{um}{uz}{fixed})
        {new_latches}
        {gd} = guards_apart(t0 + part, {new}{d}{uz}{fixed})
        {zeroed}
        {inputs_rest}
        {k1} = rates_apart(t0 + part, {new}{d}{uz}{fixed})
        {e} = step_apart(t0 + part, span - part, {new}{d}{k1s}{um}{ub}{fixed})
        {ge} = guards_apart(time + h, {new}{e}{ub}{fixed})
        done = select(crossing, 0.0, done + (1.0 - done) * fraction, done)
        {commit}
        {c} = crossings({latches}{ga}{gb})
        crossing = select(crossing, 0.0, {any_crossing}, -1.0)
        if not any_above(crossing, 0.0):
            break
    return {located}
'''


def any_crossing(parts: Parts) -> str:
    """Return the expression that is positive where some guard changes its sign."""
    return nested("max", "c_", parts.all_guards)


def locate_text(parts: Parts) -> str:
    """Return the function that cuts a step at its kinks, with what it needs; guards are expected."""
    guards = parts.all_guards
    pairs = list(zip(parts.latches, parts.latch_guards, strict=True))
    crossing = [*(f"falls({k}, gb_{g})" for k, g in pairs), *(f"0.0 - ga_{g} * gb_{g}" for g in parts.guards)]
    new = [f"new_{k} = select(crossing, 0.0, select(z_{g}, z, {k}, 1.0), {k})" for k, g in pairs]
    hit = [f"{t} = select(new_{k}, {k}, t0 + part, {t})" for k, t in zip(parts.latches, parts.times, strict=True)]
    located = [*parts.latches, *parts.times, *(f"b_{n}" for n in parts.states), *(f"gb_{g}" for g in guards)]
    return ROOT.format(
        **parts.lists, **input_lines(parts),
        crossing_tuple=f"({listed('', crossing)})", any_crossing=any_crossing(parts),
        middle_states=each(parts.states, "m_@ = 0.5 * (a_@ + b_@) + 0.125 * span * (fa_@ - fb_@)", 8),
        roots=each(guards, "z_@ = root(c_@, ga_@, gm_@, gb_@)", 8), first_root=nested("min", "z_", guards),
        new_latches=block([*new, *hit], 8), zeroed=each(parts.guards, "gd_@ = select(z_@, z, gd_@, 0.0)", 8),
        commit=commit(parts), located=f"({listed('', located)})",
    )  # fmt: skip


def input_lines(parts: Parts) -> dict[str, str]:
    """Return the lines that interpolate the inputs inside the step."""
    lines = {
        "inputs_start": "us_@ = ua_@ + (ub_@ - ua_@) * done",
        "inputs_middle": "um_@ = 0.5 * (us_@ + ub_@)",
        "inputs_cut": "uz_@ = us_@ + (ub_@ - us_@) * fraction; um_@ = 0.5 * (us_@ + uz_@)",
        "inputs_rest": "um_@ = 0.5 * (uz_@ + ub_@)",
    }
    return {name: each(parts.inputs, line, 8) for name, line in lines.items()}


def commit(parts: Parts) -> str:
    """Return the lines that take the cut step in the lanes with a change, and nothing in the others."""
    taken = (("a", "d", parts.states), ("b", "e", parts.states),
             ("ga", "gd", parts.all_guards), ("gb", "ge", parts.all_guards))  # fmt: skip
    lines = [f"{v}_{n} = select(crossing, 0.0, {w}_{n}, {v}_{n})" for v, w, names in taken for n in names]
    return block([*lines, *(f"{k} = new_{k}" for k in parts.latches)], 8)


def cut_text(parts: Parts, suffix: str) -> str:
    """Return the lines that look for kinks inside the step and cut it there."""
    x, u, guards, fixed = parts.states, parts.inputs, parts.all_guards, listed("", parts.fixed)
    latches, times = listed("", parts.latches), listed("", parts.times)
    ends = f"{listed('', x)}{listed('b_', x)}{listed('ga_', guards)}{listed('gb_', guards)}"
    given = f"{latches}{times}{ends}{listed('ua_', u)}{listed('ub_', u)}{fixed}"
    after = f"time + h, {latches}{listed('b_', x)}{listed('ub_', u)}{fixed}"
    result = f"{latches}{times}{listed('b_', x)}{listed('gb_', guards)}".rstrip()
    lines = [
        f"{target('gb_', guards)} = guards{suffix}({after})",
        f"{target('c_', guards)} = crossings({latches}{listed('ga_', guards)}{listed('gb_', guards)})",
        f"if any_above({any_crossing(parts)}, 0.0):",
        f"    {result} = locate(splat(0.0) + time, splat(0.0) + h, {given})",
        *(f"ga_{g} = gb_{g}" for g in guards),
    ]
    return block(lines, 8)
