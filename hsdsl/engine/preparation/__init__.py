"""From what was asked to a job for an engine.

`pipeline` makes each stage of a model once: mathematics, program, kernels, compiled code. `options` are those of the
file, of ``--set`` and of a call; `values` the parameters, constants and initial states; `settings` the numbers of a
run. `automatic` chooses the method, `engines` the loop, `mechanical` recognises one mass and one stop. `waiting` has
executions of events that a run begins with; `visible` is a run of a system of parts as its readers see it.
"""
