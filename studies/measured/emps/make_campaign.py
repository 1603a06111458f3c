"""Write the EMPS set as a campaign, as `armid import emps` does.

python studies/measured/emps/make_campaign.py --data FOLDER --out CAMPAIGN
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import main

from armid.record.importers import import_emps

if __name__ == "__main__":
    main(import_emps)
