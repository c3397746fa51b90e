"""Parameters from measurements: least squares over executions, with their exact derivatives.

`data` reads measurements, `least_squares` fits, `fit` is what was found.
"""
