"""Make campaigns of SYNTHETIC records of the shell transfer arm.

    python studies/test_stand.py OUT_FOLDER [--p0 3.05e6 --k 1.0 --eta3 0.55 --n 1.4] [--effect coulomb=40 ...]
    python studies/test_stand.py blind OUT_FOLDER --seed 1 [--only control,coulomb]
    python studies/test_stand.py advice OUT_FOLDER --seed 1
    python studies/test_stand.py advised OUT_FOLDER --seed 1 --base ADVICE_FOLDER --reports RESULTS_FOLDER

The stand plays the machine: it simulates the declared arm, with any undeclared effects that are asked for, and measures
it with a noisy gyro. It shares no code with `src/`, so a campaign is an independent check of what identifies it.
`blind` makes many campaigns that do not tell their truth: OUT_FOLDER.key.json does, which `studies/blind/score.py`
reads, and no loop. RESULTS_FOLDER holds a folder for each campaign with the report.json of `armid close-loop`.
`advice` makes campaigns of few strokes that leave two effects in doubt, `advised` adds the record that was advised,
and in its place a random one.
No machine was measured; the constants of the arm are engineering estimates. `--help` lists every option.

The exit code is 0 when all is written and 2, with one sentence on stderr, when the input is refused. To make a single
campaign in a folder that is called like a command, write ./blind.
"""

import sys

from stand.advice import make_base, make_more
from stand.blind.campaign import main as make_blind
from stand.command import main as make_campaign

COMMANDS = {"blind": make_blind, "advice": make_base, "advised": make_more}

if __name__ == "__main__":
    words = sys.argv[1:]
    sys.exit(COMMANDS[words[0]](words[1:]) if words and words[0] in COMMANDS else make_campaign(words))
