"""Mathematics to routines.

In: a `HybridSystem`. Out: a `program.Program`, straight-line routines as text over numbered names, free of SymPy.

Read in this order: `completion` (flows where transitions accumulate: along guards, sliding), `lower` (surfaces, rates,
gradients, bounds on round-off), `program`. `decisions` answers whether a point with given properties exists, for lint
and for imports. `program_cache` keeps the programs of models read before.
"""
