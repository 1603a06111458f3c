"""The verdict of the closed loop, in one sentence."""

from armid.discrepancy.result import EXPLAINED, NO_DISCREPANCY, PARTLY, TOO_ALIKE, UNEXPLAINED, ClosedLoop

TIMES = {"1": "", "direction": ", times the direction of motion,", "drive_effort": ", times the effort of the drive,"}


def conclusion(found: ClosedLoop) -> str:
    """Return the verdict as one sentence."""
    if found.verdict == TOO_ALIKE:
        return doubtful(found)
    if found.term is not None:
        return partly_empirical(found)
    names = " + ".join(found.effects)
    return {
        NO_DISCREPANCY: "What the declared model leaves is noise: nothing is missing that these records could show.",
        EXPLAINED: f"The declared model lacked {names}; with it, what remains is noise on train and holdout.",
        PARTLY: f"The declared model lacks {names}, but a significant discrepancy remains: that is part of the story.",
        UNEXPLAINED: "The declared model lacks something, but no effect of the library earns its parameters.",
    }[found.verdict]


def doubtful(found: ClosedLoop) -> str:
    """Return which effects would do as well."""
    if found.refused is not None:
        rivals = [r.name for r in (*found.refused.alike, *found.refused.unlike)]
        return (f"The declared model lacks something, but on these records {len(rivals) + 1} effects would do nearly "
                f"as well ({found.refused.name}, {', '.join(rivals[:6])}): none is named.")  # fmt: skip
    said = [f"{s.effect} cannot be told from {' or '.join(s.alternatives)}" for s in found.steps if s.alternatives]
    said += [f"{s.effect} fits hardly better than {' or '.join(r.name for r in s.group.unlike)}"
             for s in found.steps if s.group.unlike]  # fmt: skip
    names = " + ".join(found.effects)
    said += [f"{names} fits hardly better than {' + '.join(r.names)}" for r in found.rivals]
    remains = "a significant discrepancy remains, and" if found.after.significant else "what remains is noise, but"
    return f"With {names} {remains} on these records {'; '.join(said)}."


def partly_empirical(found: ClosedLoop) -> str:
    """Return what the empirical term stands for."""
    assert found.term is not None
    named = " + ".join(found.effects[:-1])
    lacking = f"The declared model lacks {named}, and beside it" if named else "The declared model lacks"
    dependence = found.term.dependence
    return (f"{lacking} something that no effect of the library explains: {found.effects[-1]} is an empirical curve "
            f"over {dependence.variable}{TIMES[dependence.factor]} at port {dependence.port}, which claims no physical "
            "name.")  # fmt: skip
