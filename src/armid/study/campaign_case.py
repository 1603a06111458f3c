"""Cases whose records are read from a campaign beside the study's file."""

import hashlib
import os.path
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath, PureWindowsPath

from armid.model import ArmidError, Model
from armid.record import Campaign, read_campaign
from armid.record.campaign_file import campaign_path
from armid.record.pieces import with_window
from armid.record.schema import unknown_name
from armid.record.shown import shown
from armid.study.box import box_of
from armid.study.case import Case, Source
from armid.study.known import Known, chosen
from armid.study.sheet import CaseSheet, StudySheet


def campaign_case(entry: CaseSheet, sheet: StudySheet, known: Known, folder: Path, where: str) -> Case:
    """Return a case of the train and holdout records of a campaign.

    Raises ArmidError for a campaign that cannot be read, has another plant, or holds no such record.
    """
    assert entry.campaign is not None
    path = campaign_folder(folder, entry.campaign, where)
    campaign = with_records(read_campaign(path, known.plants, known.effects), entry.records, where)
    if campaign.plant.name not in {v.name for v in known.plants[sheet.plant].variants} | {sheet.plant}:
        raise ArmidError(f"{where}: the campaign is of plant '{campaign.plant.name}', '{sheet.plant}' is expected")
    model = Model(campaign.plant)
    for name in dict.fromkeys((*campaign.effects, *sheet.effects)):
        model = model + chosen(known.effects, name, "effect", where)
    space = box_of(model, campaign.parameters, sheet, entry, where)
    check_windows(campaign, sheet, where)
    files = tuple(r.file for r in campaign.records)
    source = Source(entry.campaign, files, digest_of(path, files))
    return Case(entry.name, model, space, dict(entry.truth), dict(entry.published), (), source)


def check_windows(campaign: Campaign, sheet: StudySheet, where: str) -> None:
    """Refuse a window that holds too little of a record."""
    for window in sheet.windows_s:
        if not isinstance(window, str):
            for record in campaign.records:
                with_window(record, window, f"{where}, windows_s")


def campaign_folder(folder: Path, campaign: str, where: str) -> Path:
    """Return where the campaign of a study is.

    Raises ArmidError for a path that leads out of the folder of the study's file, also through a link.
    """
    pure = PurePosixPath(campaign.replace("\\", "/"))
    if pure.is_absolute() or PureWindowsPath(campaign).drive or ".." in pure.parts or not campaign.isprintable():
        raise ArmidError(f"{where}: campaign {shown(campaign)} leads out of the folder of the study, a folder inside "
                         "is expected")  # fmt: skip
    try:
        toml = campaign_path(folder / pure)
    except ArmidError as error:
        raise ArmidError(f"{where}: {error}") from error
    if not Path(os.path.realpath(toml)).is_relative_to(os.path.realpath(folder)):
        raise ArmidError(f"{where}: campaign {shown(campaign)} links out of the folder of the study, a folder inside "
                         "is expected")  # fmt: skip
    return toml.parent


def with_records(campaign: Campaign, files: Sequence[str] | None, where: str) -> Campaign:
    """Return the campaign with some of its records, None: all.

    Raises ArmidError for a file that is none of its records, and where none is left to train on.
    """
    if files is None:
        return campaign
    there = [r.file for r in campaign.records]
    for file in files:
        if file not in there:
            raise unknown_name("record", file, there, where)
    some = replace(campaign, records=tuple(r for r in campaign.records if r.file in files))
    if not some.train:
        raise ArmidError(f"{where}: none of the records {', '.join(files)} has the role 'train'")
    return some


def digest_of(folder: Path, files: Sequence[str]) -> str:
    """Return a hash of campaign.toml and some CSV files of a campaign."""
    digest = hashlib.sha256()
    for name in ("campaign.toml", *files):
        content = (folder / name).read_bytes()
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()
