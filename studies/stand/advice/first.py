"""Make the campaigns of few strokes that leave a pair of effects in doubt."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from stand.advice.pairs import Pair, Proof
from stand.blind.campaign import Measured, campaign_text, measure_stroke
from stand.blind.case import Case
from stand.blind.draw import Drawn, Strokes, draw, six_strokes
from stand.blind.suite import Planted
from stand.campaign import record_text
from stand.trajectory import SAMPLES_PER_SECOND

Entry = dict[str, Any]


@dataclass(frozen=True)
class First:
    """Hold a campaign to be: its pair, and which one of its seeds from 1."""

    pair: Pair
    place: int
    seed: int

    @property
    def name(self) -> str:
        """Give the name of the campaign."""
        return f"{self.pair.letter}{self.place:02d}"

    @property
    def key(self) -> tuple[int, int, int]:
        """Give what all its draws are seeded with."""
        return (self.seed, ord(self.pair.letter), self.place)

    def case(self) -> Case:
        """Plant the one effect and the other in turn; noise is white, since coloured noise asks for larger effects."""
        kind = self.pair.kinds[self.place % 2]
        sign = 1.0 if np.random.default_rng([*self.key, 0]).random() < 0.5 else -1.0
        return Case(self.place, "single", (kind.planted(1, sign),), coloured=False)


def drawn_of(proof: Proof, first: First) -> Drawn:
    """Draw arm, manoeuvres and noise of a campaign, the same ones each time."""
    return draw(proof.suite, first.case(), np.random.default_rng([*first.key, 1]), _chosen(first.pair))


def _chosen(pair: Pair) -> Strokes:
    """Give what draws the strokes of a pair, all of them to train on."""

    def strokes(rng: np.random.Generator) -> Any:
        return tuple((manoeuvre, "train") for manoeuvre, _ in six_strokes(rng) if manoeuvre.name in pair.strokes)

    return strokes


def make_first(proof: Proof, first: First) -> tuple[dict[str, bytes], Entry]:
    """Make the files of a campaign, which tell nothing of its truth, and its entry in the key."""
    drawn, rng = drawn_of(proof, first), np.random.default_rng([*first.key, 2])
    rest = round(proof.suite.rest_s * SAMPLES_PER_SECOND)
    effects = first.case().effects()
    measured = [measure_stroke(drawn, place, effects, rest, rng) for place in range(len(drawn.strokes))]
    return files_of(first.name, drawn, measured), entry_of(first, drawn)


def files_of(name: str, drawn: Drawn, measured: list[Measured]) -> dict[str, bytes]:
    """Write the records of a campaign and its campaign.toml."""
    texts = {each.record.file: record_text(each.record, drawn.gyro.decimals) for each in measured}
    texts["campaign.toml"] = campaign_text(name, drawn, measured)
    return {file: text.encode() for file, text in texts.items()}


def entry_of(first: First, drawn: Drawn) -> Entry:
    """Give the truth of a campaign."""
    (planted,), gyro = first.case().planted, drawn.gyro
    return {
        "class": "pair",
        "pair": list(first.pair.names),
        "place": first.place,
        "parameters": {name: getattr(drawn.arm, name) for name in ("p0", "k", "eta3", "n")},
        "effects": [_told(planted)],
        "noise": {"kind": "coloured" if gyro.noise_bandwidth_hz else "white", "rms_deg_s": gyro.noise_deg_s},
        "floor": {"train": None, "holdout": None},
        "declared_fit": None,
    }


def _told(planted: Planted) -> Entry:
    kind = planted.kind
    return {
        "name": kind.name,
        "port": kind.port,
        "form": kind.form,
        "matching": True,
        "listed": True,
        "strength": 1,
        "sizes": dict(planted.sizes),
    }
