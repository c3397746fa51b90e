"""Decisions on models for lint rules: is there a point of a domain or a guard where some constraints hold?

A system comes in, a `Dynamics` of it answers questions; an answer has the kind of its decision, and the point.

=============== =====================================================================================================
`dynamics`      surfaces, rates, domains and guards with the values of parameters; proofs, and points in words
`transitions`   crossings of guards, landings of resets, and whether simultaneous transitions commute
`mode_point`    what a run does next from one point, in numbers
`singularities` jumps, kinks and poles of expressions, and their smooth pieces
`decide`        answers: exact elimination and bounds, then `search` for a point, then branch and bound
`polynomial`    expressions in a normal form with exact coefficients
=============== =====================================================================================================
"""
