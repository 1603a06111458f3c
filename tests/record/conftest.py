"""Small campaigns to read: an arm with rest, and a driven axis."""

from collections.abc import Mapping

import numpy as np
import pytest

from input_texts import LOWERING

ARM_TOML = f'name = "c00"\nplant = "shell_transfer_arm"\n\n{LOWERING}'
AXIS_TOML = """\
name = "axis"
plant = "driven_axis"

[constants]
gain = 35.0

[[records]]
file = "move.csv"
role = "train"
"""


def csv_text(columns):
    """Return columns as the text of a CSV file, every digit kept."""
    rows = zip(*(np.asarray(values, dtype=float).tolist() for values in columns.values()), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n"


@pytest.fixture
def arm_columns():
    """Columns of a lowering: 100 ms of rest, then 1.2 s at 1 kHz."""
    rng = np.random.default_rng(1)
    times = np.arange(-100, 1201) / 1000
    speed = np.where(times > 0, 60 * (1 - np.cos(5 * times)), 0.0)
    return {"time_s": times, "angular_velocity_deg_s": np.round(speed + rng.normal(0, 0.3, times.size), 2)}


@pytest.fixture
def axis_columns():
    """Columns of a driven axis: 5.5 s at 1 kHz, speed and position that belong together."""
    times = np.arange(5501) / 1000
    return {
        "time_s": times,
        "velocity_m_s": 0.2 * np.cos(2 * times + 0.3),
        "drive_V": 3.0 * np.sin(2 * times),
        "position_m": 0.1 * np.sin(2 * times + 0.3),
    }


@pytest.fixture
def write(tmp_path, arm_columns):
    """Return a function that writes a campaign, by default one lowering, and returns its folder.

    toml: the text of campaign.toml. files: name -> columns, text or bytes of a CSV file.
    """

    def written(toml=ARM_TOML, **files):
        folder = tmp_path / "campaign"
        folder.mkdir(exist_ok=True)
        (folder / "campaign.toml").write_bytes(toml.encode() if isinstance(toml, str) else toml)
        for name, content in (files or {"lower": arm_columns}).items():
            text = csv_text(content) if isinstance(content, Mapping) else content
            (folder / f"{name}.csv").write_bytes(text.encode() if isinstance(text, str) else text)
        return folder

    return written


@pytest.fixture
def write_axis(write, axis_columns):
    """Return a function that writes a campaign of a driven axis with one record, `move.csv`."""

    def written(more="", columns=None, toml=AXIS_TOML):
        return write(toml + more, move=axis_columns if columns is None else columns)

    return written
