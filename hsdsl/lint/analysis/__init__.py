"""The mathematics that lint rules need: whether there is a point of a domain or a guard where something holds.

`dynamics` puts a model into expressions with its parameters' values; `decide` answers questions about them: by exact
reasoning (`elimination` and `bound_propagation`, with `polynomial`, `normal_form` and `rational_bounds`), by a point
(`rational_witness`, `newton_search`), or by interval arithmetic (`branch_and_bound`). An answer says which of these
decided it, and carries the point.
"""
