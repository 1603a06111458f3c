"""Write two swing-ups of DFKI's pendulum as a campaign, as `armid import dfki` does.

python studies/measured/dfki_simple_pendulum/make_campaign.py --data FOLDER --out CAMPAIGN [--holdout RECORD]
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import main

from armid.record.importers import DFKI_RECORDS, import_dfki

if __name__ == "__main__":
    main(import_dfki, holdout=DFKI_RECORDS)
