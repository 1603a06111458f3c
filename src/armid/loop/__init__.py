"""The closed loop: residual, missing effect, extended model, error before and after.

What is missing is inferred in `armid.inference`. Here, in reading order:

close_loop   the model in force, the judgement on records held out, the verdict, the record to make next
result       records that differ, report.json
document     what is shown; `figures`: what is drawn

`Judgement`  one model, and what it leaves on train and held-out records
`Step`       one effect that was added
"""

from armid.loop.close_loop import close_loop
from armid.loop.result import ClosedLoop, Judgement, Step, report_of

__all__ = ["ClosedLoop", "Judgement", "Step", "close_loop", "report_of"]
