"""A case of a study: where its records come from, what is searched between which bounds, and the truth."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from armid.model import Model
from armid.problem import Space


@dataclass(frozen=True)
class Stroke:
    """Hold a manoeuvre that is simulated: its constants (SI), length [s] and role."""

    constants: Mapping[str, float]
    duration_s: float
    role: str


@dataclass(frozen=True)
class Source:
    """Hold a campaign that is read.

    campaign: folder, relative to the study's file. records: files of it. digest: hash of these files and of
    campaign.toml, so that runs on other records are other runs.
    """

    campaign: str
    records: tuple[str, ...]
    digest: str


@dataclass(frozen=True, eq=False)
class Case:
    """Hold one case.

    truth: parameter -> true value, SI, empty where not known; all parameters of the model where the records are
    simulated. published: values of others to stand beside. space: bounds and fixed values.
    strokes: manoeuvres to simulate, or source: the campaign to read.
    """

    name: str
    model: Model
    space: Space
    truth: Mapping[str, float] = field(default_factory=dict)
    published: Mapping[str, float] = field(default_factory=dict)
    strokes: tuple[Stroke, ...] = ()
    source: Source | None = None

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Free parameter -> bounds, SI."""
        box = zip(self.space.names, self.space.low, self.space.high, self.space.free, strict=True)
        return {name: (float(low), float(high)) for name, low, high, free in box if free}

    @property
    def fixed(self) -> dict[str, float]:
        """Fixed parameter -> value, SI."""
        values = zip(self.space.names, self.space.fixed, self.space.free, strict=True)
        return {name: float(value) for name, value, free in values if not free}
