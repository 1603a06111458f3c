"""One inference for what a model lacks: hypotheses, their evidence, and a posterior over sets of them.

In reading order:

whitening     train records with their noise -> residuals whose noise is white
library       the candidate effects, compiled together and ready to be tried
model         a model at its estimate
score_test    what each candidate would change, to first order
refit         a model fitted again with an effect more, less or other
checks        whether a residual is more than noise, and where
kinds         the kinds of hypotheses: effects, faults of records, drifts, a signal without a form
"""
