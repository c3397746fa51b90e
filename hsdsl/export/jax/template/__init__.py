"""The part of an exported module that no model changes, in the order in which it is written there.

============ =======================================================================
`functions`  the functions of routines, without a value where they have no real one
`model`      what is generated from a model, and its routines with derivatives
`steps`      steps of a table and their interpolants
`lane`       a run under way, and what it records
`surfaces`   round-off, depth, and where a surface was crossed along a step
`control`    the step size
`trials`     one step as tried, in both schemes
`relaxed`    crossings on the interpolant, and the strip
`located`    crossings at their own instant
`rest`       rest on a guard, and Zeno tails that end in it
`entry`      entering a mode, where transitions may fire at once
`run`        the loop
============ =======================================================================
"""

PARTS = (
    "functions", "model", "steps", "lane", "surfaces", "control", "trials", "relaxed", "located", "rest", "entry",
    "run",
)  # fmt: skip
