"""The closed loop: residual, missing effect, extended model, error before and after.

How it decides, in reading order:

close_loop       the whole way, and the verdict
whitening        train records with their noise -> residuals whose noise is white
candidates       the effects that may be missing, compiled together; the grid on which they are tried
score_test       how far each candidate would bring the residual down, to first order
fit              a model at its least-squares estimate; whether a larger one earns its parameters
suspects         whether one record disagrees with the others, and how
constants        whether constants within their tolerances do what an effect is to do, or a trend from record to record
search           refits, exchanges, models with one effect more
equivalence      effects that the records cannot tell apart
diagnose         whether what remains is more than noise, and where

Beside it: missing_signal and empirical (where no effect will do), result
(report.json), document and figures (what is shown).

`WhitenedData`  the train records with their noise
`EffectKey`     an effect in one of its forms, its shape fixed or free
`Fit`           a model at its estimate
`Residuals`     what a fit leaves on records, measured minus simulated
"""

from armid.loop.close_loop import close_loop
from armid.loop.result import ClosedLoop, Judgement, Step, report_of

__all__ = ["ClosedLoop", "Judgement", "Step", "close_loop", "report_of"]
