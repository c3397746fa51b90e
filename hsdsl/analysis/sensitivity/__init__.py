"""Sensitivities of executions: derivatives of states, transition times and outputs, through jumps.

`targets` reads what is differentiated by, `overrides` puts the overrides of a run into the mathematics, `augment`
writes the system with its variational equations and saltation matrices as an ordinary hybrid system, and `result` reads
the derivatives off an execution of it; `summary` has them as text and JSON.

`augment` builds on `dependence` (which derivatives are not zero), `derivatives` (total ones of initial values and
inputs), `chain` (the chain rule) and `state_names`. `ties`, `landing` and `touching` find where no derivative exists.
"""
