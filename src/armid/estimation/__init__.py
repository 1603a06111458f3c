"""Parameters from records, and how well the records pin them down.

identify        search the free parameters, judge the best candidate on train and holdout
least_squares   the least-squares problem, its Jacobian, Levenberg-Marquardt, starts
information     sensitivities, Fisher information, intervals
profile         profile likelihood
design          what one more record would buy
examine         all of these for one campaign; groups of parameters that move together

What is shown of the results: identify_document, identifiability_document, with their figures.
"""
