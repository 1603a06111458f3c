"""Constants of a record: what the campaign and the record say, laid over each other."""

from collections.abc import Mapping

from armid.model import ArmidError, ManoeuvreKey, Plant, nearest
from armid.record.kinds import KindError, number
from armid.record.schema import RecordSheet
from armid.record.shown import shown
from armid.record.table import LARGEST

MEASURED_STATE = ("start_position", "start_speed")
ROUNDING = 1e-9


def record_constants(plant: Plant, shared: Mapping[str, float], sheet: RecordSheet, where: str) -> dict[str, float]:
    """Return the constants of a record's manoeuvre, SI: the campaign's, then its keys, then [records.constants].

    Raises ArmidError for an unknown constant, a missing key, a value of another kind or outside its range.
    """
    check_names(plant, shared, "constants of the campaign", where)
    check_names(plant, sheet.constants, "constants", where)
    own = {k.constant: key_value(k, sheet.keys[k.key], where) for k in plant.keys if k.key in sheet.keys}
    constants = {**shared, **own, **sheet.constants}
    for key in plant.keys:
        check_key(key, constants, where)
    return constants


def check_names(plant: Plant, given: Mapping[str, float], what: str, where: str) -> None:
    """Refuse a constant that the plant does not have, or that the record's own start sets."""
    known = [c.name for c in plant.constants]
    for name in given:
        if name not in known:
            raise ArmidError(f"{where}: {shown(name)} in {what} is no constant of plant '{plant.name}', "
                             f"{nearest(name, known)}")  # fmt: skip
        if not plant.from_rest and name in MEASURED_STATE:
            raise ArmidError(f"{where}: '{name}' in {what} is set, but it comes from the first samples of a record: "
                             "another constant is expected")  # fmt: skip


def key_value(key: ManoeuvreKey, value: object, where: str) -> float:
    """Return the constant (SI) that a key of the plant sets."""
    if key.boolean:
        if isinstance(value, bool):
            return float(value)
        raise ArmidError(f"{where}: key '{key.key}' is {shown(value)}, true or false is expected")
    try:
        return key.factor * number(value)
    except KindError as error:
        raise ArmidError(f"{where}: key '{key.key}' is {shown(value)}, a finite number is expected") from error


def check_key(key: ManoeuvreKey, constants: Mapping[str, float], where: str) -> None:
    """Refuse a manoeuvre without a required key, outside the machine's travel, or without a motion."""
    if key.constant not in constants:
        if key.required:
            raise ArmidError(f"{where}: key '{key.key}' is missing, {range_of(key)} is expected, here or as "
                             f"{key.constant} under [constants]")  # fmt: skip
        return
    value = constants[key.constant] / key.factor
    if key.unlike and constants[key.constant] == constants.get(key.unlike):
        raise ArmidError(f"{where}: {key.key} is {value:.9g}, where the record starts: a motion is expected")
    slack = ROUNDING * abs(value)
    low = key.low if key.low is not None else -LARGEST / abs(key.factor)
    high = key.high if key.high is not None else LARGEST / abs(key.factor)
    if not low - slack <= value <= high + slack or (key.boolean and value not in (0.0, 1.0)):
        raise ArmidError(f"{where}: {key.key} is {value:.9g}, {range_of(key)} is expected")


def range_of(key: ManoeuvreKey) -> str:
    """Return in words what a key may be."""
    if key.boolean:
        return "true or false"
    if key.low is None and key.high is None:
        return "a finite number"
    if key.low is None or key.high is None:
        return f"at most {key.high:g}" if key.low is None else f"at least {key.low:g}"
    return f"a value from {key.low:g} to {key.high:g}"
