"""Texts that several folders of tests write into files: a lowering, the head of a blind suite, a study, any table."""

import json

LOWERING = """\
[[records]]
file = "lower.csv"
role = "train"
start_angle_deg = -48.0
target_angle_deg = 22.0
shell = true
supply_V = 28.0
"""
SUITE_HEAD = """\
[suite]
bandwidth_hz = 40.0
noise_deg_s = [0.25, 0.30]
duration_s = [1.0, 1.1]
rest_s = 0.2
margin = 0.1
controls = 1
[suite.ranges]
p0 = [2.6e6, 3.5e6]
k = [0.6, 1.1]
eta3 = [0.45, 0.70]
n = [0.9, 1.5]
"""
TABLE_STUDY = """\
name = "tiny"
question = "Does a report come out of a real store?"
report = "table1"
plant = "shell_transfer_arm"
budget = 30
seeds = 2
fitness = "rmse"
windows_s = [[0.0, 0.3]]

[[identifiers]]
name = "pso"
label = "pso, the literal limit of the paper"
options = { n_particles = 10 }

[[identifiers]]
name = "random"

[[cases]]
name = "row 1"
truth = { p0 = 3.20e6, k = 1.00, eta3 = 0.62, n = 1.00 }
published = { p0 = 3.2114e6, k = 1.0026, eta3 = 0.6213, n = 1.0124 }
manoeuvres = [{ start_angle_deg = -48.0, target_angle_deg = 22.0, shell = true, supply_V = 28.0, duration_s = 0.3 }]

[bounds]
p0 = [2.6e6, 3.5e6]
k = [0.6, 1.1]
eta3 = [0.45, 0.70]
n = [0.9, 1.5]
"""


def on_one_line(value):
    """Return a value as TOML has it on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for lone surrogates, which no UTF-8 file holds
        return json.dumps(value.encode("utf-8", "replace").decode())
    if isinstance(value, dict):
        return "{" + ", ".join(f"{on_one_line(str(k))} = {on_one_line(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(on_one_line, value)) + "]"
    return repr(value)


def toml_of(table):
    return "".join(f"{on_one_line(str(k))} = {on_one_line(v)}\n" for k, v in table.items()).encode()
