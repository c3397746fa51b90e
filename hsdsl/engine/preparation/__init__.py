"""From what was asked to a job for an engine.

`options` are those of the file, of ``--set`` and of a call, resolved to one each. `values` are numbers: parameters and
constants of one run or of many; `experiment` has its settings and its start. `pipeline` makes each stage of a model
once, mathematics, program, kernels, compiled code, and prepares runs. `automatic` chooses the method, `mechanical`
recognises one mass and one stop. `visible` is a run of a system of parts as its readers see it.
"""
