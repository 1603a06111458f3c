"""Texts that several folders of tests write into files: a lowering of the arm, the head of a blind suite."""

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
