"""Parameters from measurements: least squares over executions, with their exact derivatives.

`least_squares` fits measurements; these, and what was found, are in `fit`.
"""
