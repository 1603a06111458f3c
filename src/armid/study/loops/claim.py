"""What a closed loop claims, and which of it is true."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

EMPIRICAL = "unnamed:"
# A group of more effects than this is no finding, whatever it holds.
LARGEST_GROUP = 4


@dataclass(frozen=True)
class Claim:
    """Hold what a report claims.

    groups: each named effect -> the effects that it cannot be told from, itself included. empirical: terms without a
    name.
    """

    groups: Mapping[str, frozenset[str]]
    empirical: tuple[str, ...]
    verdict: str

    @property
    def said(self) -> str:
        """The names, each with what it cannot be told from."""
        told = [" or ".join((name, *sorted(group - {name}))) for name, group in self.groups.items()]
        return "; ".join((*told, *self.empirical))


@dataclass(frozen=True)
class Matched:
    """Hold which truths are named, which are held by a group alone, and which names belong to no truth."""

    named: tuple[str, ...]
    grouped: tuple[str, ...]
    extra: tuple[str, ...]


def claim_of(report: Mapping[str, Any]) -> Claim:
    """Return what a report claims in the end; an effect that was added and taken out again does not count."""
    steps = {step["effect"]: step for step in report["steps"]}
    empirical = tuple(n for n in report["effects"] if n.startswith(EMPIRICAL) or steps.get(n, {}).get("empirical"))
    named = [name for name in report["effects"] if name not in empirical]
    groups = {name: frozenset((name, *steps.get(name, {}).get("alternatives", ()))) for name in named}
    return Claim(groups, empirical, report["verdict"])


def matched(truths: Sequence[str], claim: Claim) -> Matched:
    """Return how a claim meets the truth: each truth by its own name, else by one group of at most 4 that holds it."""
    named = tuple(truth for truth in truths if truth in claim.groups)
    free = {name: group for name, group in claim.groups.items() if name not in named}
    grouped = []
    for truth in truths:
        holding = next((n for n, g in free.items() if truth in g and len(g) <= LARGEST_GROUP), None)
        if truth not in named and holding is not None:
            grouped.append(truth)
            del free[holding]
    return Matched(named, tuple(grouped), tuple(free))


def judgement(label: str, truths: Sequence[str], claim: Claim, match: Matched) -> str:
    """Return one word for a campaign of a class.

    control, or nothing to find: right, false_alarm. unlisted: claimed (names alone are said to explain all), else
    empirical, partial, none. Others: right, group (a group holds what is not named), right_with_extra, half,
    half_with_extra (one of two), wrong, cannot_tell, empirical, none.
    """
    if label == "unlisted":
        claimed = bool(claim.groups) and claim.verdict == "explained"
        return "claimed" if claimed else "empirical" if claim.empirical else "partial" if claim.groups else "none"
    if not truths:
        silent = not claim.groups and not claim.empirical and claim.verdict == "no_discrepancy"
        return "right" if silent else "false_alarm"
    found = len(match.named) + len(match.grouped)
    if found:
        return found_word(found == len(truths), match)
    if claim.groups:
        return "wrong"
    return "empirical" if claim.empirical else "cannot_tell" if claim.verdict == "cannot_tell_apart" else "none"


def found_word(is_whole: bool, match: Matched) -> str:
    """Return the word for a claim that holds some truth."""
    word = "right" if is_whole else "half"
    if match.extra:
        return f"{word}_with_extra"
    return "group" if is_whole and match.grouped else word
