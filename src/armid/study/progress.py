"""How far a study is, shown on a terminal."""

import sys
import time
from typing import Any

from armid.study.outcome import Outcome
from armid.study.store import Counts


class Watch:
    """Count runs and simulations, and show a bar with rate and time left on a terminal, nothing elsewhere."""

    def __init__(self) -> None:
        self.finished, self.simulations = 0, 0
        self._began = time.monotonic()
        self._bar: Any = None

    def __enter__(self) -> "Watch":
        if sys.stderr.isatty():
            from rich.console import Console  # noqa: PLC0415 - takes time to import
            from rich.progress import BarColumn, Progress, TextColumn  # noqa: PLC0415

            self._bar = Progress(
                TextColumn("{task.completed:.0f}/{task.total:.0f} runs"), BarColumn(),
                TextColumn("{task.fields[rate]}"), TextColumn("{task.fields[left]}"),
                console=Console(stderr=True), refresh_per_second=4,
            )  # fmt: skip
            self._task = self._bar.add_task("", total=1, visible=False, rate="", left="")
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def update(self, counts: Counts, outcome: Outcome | None) -> None:
        """Move the bar: counts at the start, and a run that has finished since."""
        if outcome is None:
            self._began = time.monotonic()
        else:
            self.finished, self.simulations = self.finished + 1, self.simulations + outcome.used
        if self._bar is not None:
            seconds = max(time.monotonic() - self._began, 1e-9)
            missing = counts.missing - self.finished
            left = f"{span(seconds / self.finished * missing)} left" if self.finished else "starting"
            told = {"completed": counts.planned - missing, "rate": self.rate(seconds), "left": left}
            self._bar.update(self._task, total=counts.planned, visible=True, **told)

    def rate(self, seconds: float) -> str:
        """Return simulations a second, or finished runs a minute where no run counts its simulations."""
        if self.simulations or not self.finished:
            return f"{self.simulations / seconds:,.0f} simulations/s"
        return f"{60.0 * self.finished / seconds:.3g} runs/min"


def span(seconds: float) -> str:
    """Return a length of time with as much detail as anyone wants: 40 s, 12 min, 3.2 h."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400.0 else f"{seconds / 3600:.1f} h"
