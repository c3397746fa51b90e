"""Numbers and what is known of their errors.

`arithmetic` is the numbers that a run computes with, `columns` those of many runs, `decimals` their text. `enclosures`
are intervals that hold a formula's values, `bernstein` the form of polynomials that bounds them, `roundoff` follows the
rounding of routines.
None imports SymPy.
"""
