"""Parameters from records, and how well the records pin them down.

identify        search the free parameters, judge the best candidate on train and holdout
least_squares   the least-squares problem, its Jacobian, Levenberg-Marquardt, starts
information     sensitivities, Fisher information, intervals, profile likelihood
noise_model     the noise of a record as fits take it: white, coloured, or learnt from the residual
bootstrap       intervals of a fitness that is not a sum of squares
constants       constants within tolerances: what they do to the records, what they leave undetermined
design          what one more record would buy
advice          which record would tell rival models apart
data_checks     signs, units, clocks and manoeuvres that look wrong, before anything is identified
corrections     the mistakes that these look for, and what undoes each
examine         all of these for one campaign; groups of parameters that move together

What is shown of the results: identify_document, identifiability_document.
"""
