"""Make a campaign of SYNTHETIC records of the shell transfer arm.

    python studies/test_stand.py OUT_FOLDER [--p0 3.05e6 --k 1.0 --eta3 0.55 --n 1.4] [--effect coulomb=40 ...]

The stand plays the machine: it simulates the declared arm, with any undeclared effects that are asked for, and measures
it with a noisy gyro. It shares no code with `src/`, so a campaign is an independent check of what identifies it.
No machine was measured; the constants of the arm are engineering estimates. `--help` lists every option.

The exit code is 0 when the campaign is written and 2, with one sentence on stderr, when the input is refused.
"""

import sys

from stand.command import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
