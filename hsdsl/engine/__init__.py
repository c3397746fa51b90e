"""Routines to executions.

In: a `Program` and the values of one run. Out: an `execution.Execution`, arrays in hybrid time (t, j), with a verdict.

Read in this order: `preparation` (from a file and its settings to a job: `pipeline`), `backends` (text to functions,
a `kernel`), `integrators` (methods as tables), `scheme` (parts of the algorithm as text that C is printed from),
`simulate` (the schemes, the definition of the algorithm, and the verdict), `runtime` (the same loop in C), `execution`.
`ahead` reads and compiles in another process.
"""
