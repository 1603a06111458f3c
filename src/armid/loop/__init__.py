"""The closed loop: residual, missing effect, extended model, error before and after."""

from armid.loop.close_loop import close_loop
from armid.loop.diagnose import Diagnosis, Finding, diagnose
from armid.loop.result import ClosedLoop, Judgement, Step, report_of

__all__ = ["ClosedLoop", "Diagnosis", "Finding", "Judgement", "Step", "close_loop", "diagnose", "report_of"]
