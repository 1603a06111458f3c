"""Write a campaign's folder, whole or not at all."""

import os
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError, shown
from armid.record.reader import NAME

Array = NDArray[np.float64]


def write_campaign(out: str | Path, campaign_toml: str, tables: Mapping[str, Mapping[str, Array]]) -> Path:
    """Write campaign.toml and its CSV files, and return the folder.

    out: the new folder. campaign_toml: the text. tables: file -> header -> values, shape (n_rows,); every number is
    written with all its digits. The folder is made beside its place and then renamed, so that nothing half-written
    is ever found there.

    Raises ArmidError when the folder holds something already, or cannot be written.
    """
    folder = Path(out)
    if os.path.lexists(folder) and not (folder.is_dir() and not any(folder.iterdir())):
        raise ArmidError(f"{shown(str(out))} exists already, a new or empty folder is expected")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder.parent, prefix=".armid-") as beside:
            made = Path(beside) / "campaign"
            made.mkdir()
            (made / NAME).write_text(campaign_toml, encoding="utf-8")
            for file, columns in tables.items():
                write_table(made / file, columns)
            if folder.is_dir():
                folder.rmdir()
            made.rename(folder)
    except OSError as error:
        raise ArmidError(f"{shown(str(out))} cannot be written: {error.strerror or error}") from error
    return folder


def write_table(path: Path, columns: Mapping[str, Array]) -> None:
    """Write columns of equal length as CSV, each number as the shortest text that reads back to the same bits."""
    rows = zip(*(np.asarray(values, dtype=np.float64).tolist() for values in columns.values()), strict=True)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(columns) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)
