"""One inference for what a model lacks: hypotheses, their evidence, and a posterior over sets of them.

In reading order:

infer         the whole way: campaign -> probabilities and intervals
whitening     train records with their noise -> residuals whose noise is white
declared      the declared model: its fit, its scales, the shapes and forms of its effects
library       the candidate effects, compiled together and ready to be tried; `candidates`: their keys and bundles
decisions     prior beliefs, from calibration.toml, and all other numbers that decide
kinds         what the declared model of the machine and its records may lack, a hypothesis, and its kinds, one file
              each: effects, faults of records, drifts, a signal without a form
model         a model at its estimate, and refits of it; `unknowns`: constants, faults, drifts, with their priors
evidence      how probable the records are in a model, and what a hypothesis more would do to that
search        which models are fitted; `moves`: from one model to its neighbours; `shooting`: far from the noise, on
              short pieces of the records first
posterior     probabilities of hypotheses and sets; intervals that count what may be missing
checks        whether a residual is more than noise, and where
carry_over    what a model predicts of what its fit has not seen: records held out, parts left out in turn
"""

from armid.inference.infer import Inference, infer, prepared

__all__ = ["Inference", "infer", "prepared"]
