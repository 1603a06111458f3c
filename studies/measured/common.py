"""What the makers of campaigns share: the text of campaign.toml, and the command line."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from armid import ArmidError, write_campaign

Entry = tuple[str, str, Mapping[str, Any], Mapping[str, float]]


def written(
    out: Path, name: str, plant: str, source: str, records: Sequence[Entry], tables: Mapping[str, pd.DataFrame],
    head: str = "",
) -> Path:  # fmt: skip
    """Write a campaign and return its folder.

    records: file, role, further keys and constants of each record; tables: file -> its columns. head: TOML tables that
    stand before the records. Raises ArmidError where the folder cannot be made.
    """
    lines = [f"# Measured. Source: {source}.", f'name = "{name}"', f'plant = "{plant}"', *head.splitlines()]
    for file, role, keys, constants in records:
        lines += ["", "[[records]]", f'file = "{file}"', f'role = "{role}"', *(f"{k} = {v}" for k, v in keys.items())]
        lines += ["[records.constants]", *(f"{k} = {v!r}" for k, v in constants.items())] if constants else []
    columns = {file: {c: t[c].to_numpy(float) for c in t.columns} for file, t in tables.items()}
    return write_campaign(out, "\n".join([*lines, ""]), columns)


def main(make: Callable[[Path, Path], Path]) -> None:
    """Write the campaign that `make(folder, out)` writes, as the command line says."""
    parser = argparse.ArgumentParser(description="Write measured records as a campaign.", allow_abbrev=False)
    parser.add_argument("--data", type=Path, required=True, help="folder with the machine's own files")
    parser.add_argument("--out", type=Path, required=True, help="folder of the campaign, new or empty")
    options = parser.parse_args()
    try:
        print(f"wrote {make(options.data, options.out)}")
    except (ArmidError, OSError) as error:
        parser.error(str(error))
