"""Before a switch, lanes without a kink take one long step; after it, lanes take finer ones."""

from armid.simulation.template.locate import any_crossing
from armid.simulation.template.parts import Parts, block, each, listed, nested, target

CALM = '''if span > 1 and any_above(0.5 - ({open_sum}), 0.0):
                h = span * interval
                {k1} = rates{apart}({time}, {latches}{x}{fixed})
                {b} = step{apart}({time}, {h}, {latches}{x}{k1s}{fixed})
                {gb} = guards{apart}({end}, {latches}{b}{fixed})
                {c} = crossings({latches}{ga}{gb})
                calm = select({open_sum}, 0.5, 0.0, select({any_crossing}, 0.0, 0.0, 1.0))
                small = any_above(1.0 - calm, 0.5)
                mixed = any_above(calm, 0.5)
                if mixed:
                    {fb} = rates{apart}({end}, {latches}{b}{fixed})
                    for i in range(span):
                        {m} = between((i + 1.0) / span, h, {x}{b}{k1s}{fbs})
                        {y_out} = recorded(time + (i + 1.0) * interval, {latches}{m}{fixed})
                        store(block, (buffered + i) * WIDTH, splat(0.0) + {y_out_value})
                if not small:
                    {take_calm}'''

REFINE = '''{advanced_n} = advance(now, interval, substeps, {state_n}{u0}{u1}{fixed})
                    flipped = {latch_sum_n} - ({latch_sum_o})
                    if any_above(fresh + flipped, 0.0):
                        {advanced_r} = advance_apart(now, interval, substeps * refinement, {state_o}{u0}{u1}{fixed})
                        share = select(flipped, 0.5, 1.0, np.minimum(fresh, 1.0))
                        {take_refined}
                    {flip_places}
                    fresh = select(flipped, 0.5, fresh_samples + {flip_place}, np.maximum(fresh - 1.0, 0.0))'''

STORE_PLAIN = "store(block, (buffered + i) * WIDTH, splat(0.0) + y_recorded)"
STORE_MIXED = '''if mixed:
                        y_recorded = select(calm, 0.5, load(block, (buffered + i) * WIDTH), y_recorded)
                    store(block, (buffered + i) * WIDTH, splat(0.0) + y_recorded)'''

KEEP_CALM = '''if mixed:
                    {keep_calm}'''


def calm_parts(parts: Parts) -> dict[str, str]:
    """Return the pieces that tell calm lanes from the others; without latches there are none."""
    if not parts.latches:
        return {"calm_block": "pass", "fine_step": plain_step(parts), "store_output": STORE_PLAIN, "keep_calm": "pass"}
    return {
        "calm_block": "pass" if parts.inputs else calm_text(parts),
        "fine_step": each(parts.carried, "o_@ = n_@", 20) + "\n" + " " * 20 + refine_text(parts),
        "store_output": STORE_MIXED,
        "keep_calm": "pass" if parts.inputs else keep_text(parts),
    }


def plain_step(parts: Parts) -> str:
    """Return the line that advances all lanes by one sample."""
    given = listed("n_", parts.carried) + "".join(parts.lists[k] for k in ("u0", "u1", "fixed"))
    return f"{target('n_', parts.carried)} = advance(now, interval, substeps, {given})"


def refine_text(parts: Parts) -> str:
    """Return the lines that repeat a sample with finer steps in the lanes that have just switched.

    The last of these samples is blended, by the place of the switch in its own sample: when a switch moves across a
    sample, what is refined moves along without a jump.
    """
    latches, times = parts.latches, parts.times
    whole = [f"n_{n} = select(share, 0.5, r_{n}, n_{n})" for n in (*latches, *times)]
    blended = [f"n_{n} = n_{n} + share * (r_{n} - n_{n})" for n in parts.carried[2 * len(latches) :]]
    places = [
        f"place_{k} = select(n_{k} - o_{k}, 0.5, (n_{t} - now) / interval, 0.0)"
        for k, t in zip(latches, times, strict=True)
    ]
    return REFINE.format(
        **{k: parts.lists[k] for k in ("u0", "u1", "fixed")},
        advanced_n=target("n_", parts.carried), state_n=listed("n_", parts.carried),
        advanced_r=target("r_", parts.carried), state_o=listed("o_", parts.carried),
        latch_sum_n=" + ".join(f"n_{k}" for k in latches), latch_sum_o=" + ".join(f"o_{k}" for k in latches),
        take_refined=block([*whole, *blended], 24), flip_places=block(places, 20),
        flip_place=nested("max", "place_", latches),
    )  # fmt: skip


def long_step(parts: Parts) -> dict[str, str]:
    """Return what a calm lane takes from the long step: name -> where it stands."""
    return {**{n: f"b_{n}" for n in parts.states}, **{f"ga_{g}": f"gb_{g}" for g in parts.all_guards}}


def calm_text(parts: Parts) -> str:
    """Return the lines that try one step over several samples in the lanes that have not switched."""
    lines = [f"{n} = {v}" for n, v in long_step(parts).items()]
    numbers = {"time": "time", "h": "h", "end": "time + h"}
    # Written into the loop once more, the equations of many effects would take half as long again to compile.
    called = {n: f"splat({text})" for n, text in numbers.items()} if parts.wide else numbers
    return CALM.format(
        **parts.lists, **called, apart="_apart" if parts.wide else "", open_sum=" + ".join(parts.latches),
        any_crossing=any_crossing(parts), take_calm=block(lines, 20),
    )  # fmt: skip


def keep_text(parts: Parts) -> str:
    """Return the lines that keep the long step where small ones were made for other lanes."""
    lines = [f"n_{n} = select(calm, 0.5, {v}, n_{n})" for n, v in long_step(parts).items()]
    return KEEP_CALM.format(keep_calm=block(lines, 20))
