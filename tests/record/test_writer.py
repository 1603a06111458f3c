"""A campaign's folder is written whole or not at all."""

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.record import write_campaign
from armid.record.table import read_table

TABLES = {"a.csv": {"time_s": np.arange(5) / 3, "velocity_m_s": np.array([0.1, 1e-300, -7.0, 1 / 3, 1e20])}}


def test_numbers_read_back_to_the_bit(tmp_path):
    folder = write_campaign(tmp_path / "deep" / "out", "name = 'x'\n", TABLES)
    assert (folder / "campaign.toml").read_text() == "name = 'x'\n"
    columns = read_table(folder / "a.csv", "a.csv").columns
    assert list(columns) == ["time_s", "velocity_m_s"]
    for name, values in TABLES["a.csv"].items():
        np.testing.assert_array_equal(columns[name], values)
    assert [p.name for p in folder.parent.iterdir()] == ["out"]


def test_an_empty_folder_may_be_there(tmp_path):
    (tmp_path / "out").mkdir()
    assert (write_campaign(tmp_path / "out", "", TABLES) / "a.csv").is_file()


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(ArmidError, match="out' exists already"):
        write_campaign(tmp_path / "out", "", TABLES)
    with pytest.raises(ArmidError, match=r"mine\.txt' exists already"):
        write_campaign(tmp_path / "out" / "mine.txt", "", TABLES)
    with pytest.raises(ArmidError, match="cannot be written"):
        write_campaign(tmp_path / "out" / "mine.txt" / "below", "", TABLES)


def test_nothing_half_written_stays(tmp_path):
    uneven = {"a.csv": {"time_s": np.arange(5), "velocity_m_s": np.arange(4)}}
    with pytest.raises(ValueError, match="shorter"):
        write_campaign(tmp_path / "out", "", uneven)
    assert list(tmp_path.iterdir()) == []
