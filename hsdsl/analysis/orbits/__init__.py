"""Periodic orbits of hybrid systems: found by shooting on a section, followed in a parameter, and judged.

`mathematics` finds how a system depends on time, lets a run begin at any phase, and has a quantity that a family of
orbits keeps; `section` is the map from one crossing of a section to a later one, the shifts that change nothing on it,
and Newton's method for its fixed points; `orbit` is what was found; `continuation` follows it in a parameter;
`sampling` tests orbital stability by runs from nearby.
"""
