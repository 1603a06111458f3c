"""The closed loop: residual, missing effect, extended model, error before and after."""

from armid.discrepancy.diagnose import Diagnosis, Finding, diagnose
from armid.discrepancy.loop import close_loop
from armid.discrepancy.result import ClosedLoop, Judgement, Step, report_of

__all__ = ["ClosedLoop", "Diagnosis", "Finding", "Judgement", "Step", "close_loop", "diagnose", "report_of"]
