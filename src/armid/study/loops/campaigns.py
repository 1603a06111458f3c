"""The campaigns of a study that closes the loop: a folder that holds one folder each."""

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from armid.model import ArmidError, nearest
from armid.record.campaign_file import NAME, SUFFIX
from armid.record.shown import shown


@dataclass(frozen=True)
class LoopCase:
    """Hold one campaign: its folder's name, and a hash of campaign.toml and the records in it."""

    name: str
    digest: str


def campaigns_in(folder: Path, campaigns: str, only: Sequence[str], made_by: str, where: str) -> tuple[LoopCase, ...]:
    """Return the campaigns of a folder, by name.

    folder: of the study's file. only: patterns of names. made_by: the command that makes them, told where it is absent.

    Raises ArmidError where there is no such folder or no campaign in it, and for a pattern that meets none.
    """
    place = folder / campaigns
    made = f", `{made_by}` makes them" if made_by else ", a folder of campaigns is expected"
    if not place.is_dir():
        raise ArmidError(f"{where}: there are no campaigns in {shown(campaigns)}{made}")
    names = sorted(path.name for path in place.iterdir() if (path / NAME).is_file())
    if not names:
        raise ArmidError(f"{where}: {shown(campaigns)} holds no folder with a {NAME}{made}")
    for pattern in only:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise ArmidError(f"{where}: key 'only' holds {shown(pattern)}, which is no campaign of "
                             f"{shown(campaigns)}, {nearest(pattern, names)}")  # fmt: skip
    chosen = [name for name in names if any(fnmatchcase(name, pattern) for pattern in only)]
    return tuple(LoopCase(name, digest_of(place / name)) for name in chosen)


def digest_of(folder: Path) -> str:
    """Return a hash of campaign.toml and all records of a campaign, so that runs on other records are other runs."""
    digest = hashlib.sha256()
    for name in sorted(name for name in os.listdir(folder) if name == NAME or name.endswith(SUFFIX)):
        content = (folder / name).read_bytes()
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()
