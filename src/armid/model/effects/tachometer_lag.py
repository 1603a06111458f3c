"""The tachometer's filter lags: tau dw/dt = omega - w, and the control sees w.

Below 1 ms the filter stays at 1 ms and takes a share tau / 1 ms of the signal: the same delay, no stiff equation, and a
derivative by tau at the null, which a filter that is switched off below some time constant would not have.
Source: Franklin, Powell, Workman, Digital Control of Dynamic Systems, chapter 5 (first-order low-pass).
"""

from armid.model.effect import Effect, State
from armid.model.effects.output_lag import lagging_rate, settled
from armid.model.effects.output_lag import output as feedback
from armid.model.parameter import Parameter

tachometer_lag = Effect(
    name="tachometer_lag",
    parameters=(Parameter("time_constant", "s", 0.0, 0.03, null=0.0, note="of the tachometer's filter"),),
    adds={"feedback": feedback},
    states=(State("lagging", "rad/s", lagging_rate, settled),),
    note="the speed that is fed back lags",
    source="Franklin, Powell, Workman, Digital Control of Dynamic Systems, chapter 5",
)
