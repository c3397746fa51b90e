"""The mathematics that lint rules need: whether there is a point of a domain or a guard where something holds.

`dynamics` puts a model into expressions with its parameters' values; `ladder` decides questions about them, by exact
reasoning (`exact` and `tighten`, with `polynomial`, `ring` and `bounds`), by a point that is found (`trial`, `points`),
or by interval arithmetic (`intervals`, `tape`, `boxes`). An answer says which of these decided it, and carries the
point.
"""
