"""The part of an exported module that no model changes, in the order in which it is written there.

============= =======================================================================
`functions`   the functions of routines, without a value where they have no real one
`modes`       what is generated from a model
`model`       its routines, with derivatives
`steps`       steps of a table and their interpolants
`lane`        a run under way, and what it records
`surfaces`    round-off, depth, and where a surface was crossed along a step
`control`     the step size
`verdicts`    one step as tried, in both schemes
`trials`      the step that counts
`transitions` where transitions go from, strips and resets
`relaxed`     crossings on the interpolant
`located`     crossings at their own instant
`contact`     motion along a guard, and Zeno tails that end in it
`entry`       entering a mode, where transitions may fire at once
`run`         the loop
============= =======================================================================
"""

PARTS = (
    "functions", "modes", "model", "steps", "lane", "surfaces", "control", "verdicts", "trials", "transitions",
    "relaxed", "located", "contact", "entry", "run",
)  # fmt: skip
