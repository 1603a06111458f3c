"""What a campaign holds and how it is written down."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stand.gyro import measure, record_times
from stand.manoeuvre import Manoeuvre
from stand.motion import Motion
from stand.settings import Settings, short
from stand.trajectory import simulate

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Record:
    """Hold one record: file name, manoeuvre, role, times [s], speeds [deg/s], and the file it repeats."""

    file: str
    manoeuvre: Manoeuvre
    role: str
    time_s: FloatArray
    speed_deg_s: FloatArray
    repeat_of: str | None = None


def make_records(settings: Settings, rng: np.random.Generator) -> list[Record]:
    """Simulate each manoeuvre once and measure it as often as asked; repeats differ by their noise alone."""
    records = []
    for index, manoeuvre in enumerate(settings.manoeuvres):
        trajectory = simulate(Motion(settings.arm, manoeuvre, settings.effects), settings.duration_s)
        role = "holdout" if manoeuvre.name in settings.holdout else "train"
        for count in range(1, 1 + (settings.repeats if index == 0 else 1)):
            original = f"{manoeuvre.name}.csv" if count > 1 else None
            file = f"{manoeuvre.name}_{count}.csv" if original else f"{manoeuvre.name}.csv"
            speed = measure(trajectory, settings.gyro, settings.effects.gyro_bias_deg_s, rng, settings.rest_samples)
            times = record_times(trajectory, settings.rest_samples)
            records.append(Record(file, manoeuvre, role, times, speed, original))
    return records


def record_text(record: Record, decimals: int) -> str:
    """Write a record as CSV: time to the millisecond, speed with the decimals of its quantisation."""
    pairs = zip(record.time_s.tolist(), record.speed_deg_s.tolist(), strict=True)
    lines = [f"{time:.3f},{_plain(speed, decimals)}" for time, speed in pairs]
    return "\n".join(["time_s,angular_velocity_deg_s", *lines, ""])


def _plain(value: float, decimals: int) -> str:
    """Write a number, a rounded -0 as 0."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def truth_lines(settings: Settings, records: list[Record]) -> list[str]:
    """Say in words what the records are made of."""
    arm, gyro, effects = settings.arm, settings.gyro, settings.effects.switched_on()
    colour = f"coloured by a {short(gyro.noise_bandwidth_hz)} Hz gyro" if gyro.noise_bandwidth_hz else "white"
    step = f"steps of {short(gyro.quantisation_deg_s)} deg/s" if gyro.quantisation_deg_s else "no quantisation"
    truth = f"p0 = {short(arm.p0)} Pa, k = {short(arm.k)}, eta3 = {short(arm.eta3)}, n = {short(arm.n)}"
    listed = ", ".join(f"{name} = {short(size)}" for name, size in effects.items()) or "none"
    limit = settings.gyro.range_deg_s - settings.gyro.quantisation_deg_s
    clipped = ", ".join(each.file for each in records if np.abs(each.speed_deg_s).max() > limit) or "none"
    return [
        f"True parameters: {truth}.",
        f"Undeclared effects: {listed}.",
        f"Noise: {short(gyro.noise_deg_s)} deg/s rms, {colour}; {step}; both are estimates.",
        f"Records that reach the gyro's range of {short(gyro.range_deg_s)} deg/s, and are cut there: {clipped}.",
        f"Seed of numpy.random.default_rng: {settings.seed}.",
        "Every other constant of the arm is an engineering estimate; the paper prints none.",
    ]


def campaign_text(settings: Settings, records: list[Record]) -> str:
    """Write campaign.toml: a comment that says synthetic and how made, then the records."""
    said = ["SYNTHETIC: a simulated shell transfer arm. No machine was measured.", f"Made by: {settings.command()}"]
    lines = [f"# {line}" for line in said + truth_lines(settings, records)]
    lines += ["", f'name = "{settings.name}"', 'plant = "shell_transfer_arm"']
    lines.append(f"gyro_range_deg_s = {short(settings.gyro.range_deg_s)}")
    for record in records:
        lines += ["", "[[records]]", *record_lines(record, settings.window_s)]
    return "\n".join([*lines, ""])


def record_lines(record: Record, window_s: tuple[float, float] | None = None) -> list[str]:
    """Write the keys of a record as campaign.toml holds them."""
    told = record.manoeuvre
    lines = [f'file = "{record.file}"', f'role = "{record.role}"']
    lines += [f"start_angle_deg = {float(told.start_deg)}", f"target_angle_deg = {float(told.target_deg)}"]
    lines += [f"shell = {str(told.shell).lower()}", f"supply_V = {float(told.supply_volt)}"]
    if window_s:
        lines.append(f"window_s = [{window_s[0]}, {window_s[1]}]")
    if record.repeat_of:
        lines.append(f'repeat_of = "{record.repeat_of}"')
    return lines


def readme_text(settings: Settings, records: list[Record]) -> str:
    """Write the campaign's README: synthetic, the truth, the records, the command that makes it again."""
    rows = [f"| {each.file} | {each.role} | {_told(each)} | {each.repeat_of or ''} |" for each in records]
    lines = [
        f"# {settings.name}: SYNTHETIC records of the shell transfer arm",
        "",
        "No machine was measured: a simulated arm was, by a simulated gyro at 1 kHz. The brake opens at t = 0.",
        "",
        *(f"- {line}" for line in truth_lines(settings, records)),
        "",
        "| file | role | manoeuvre | repeats |",
        "|---|---|---|---|",
        *rows,
        "",
        "Made again, from the root of the project, by",
        "",
        "```",
        f"{settings.command()} --force",
        "```",
    ]
    return "\n".join([*lines, ""])


def _told(record: Record) -> str:
    told = record.manoeuvre
    load = "with the shell" if told.shell else "without the shell"
    return f"{short(told.start_deg)} to {short(told.target_deg)} deg, {load}, {short(told.supply_volt)} V"
