"""Decisions on models for lint rules: is there a point of a domain or a guard where some constraints hold?

`dynamics` has the surfaces, rates, domains and guards of a model, with the values of its parameters. `decide` answers
questions about them by exact reasoning (`elimination`, `rational_bounds`), by a search for a
point, or by interval arithmetic (`newton_search`). An answer has the kind of its decision, and the point.
"""
