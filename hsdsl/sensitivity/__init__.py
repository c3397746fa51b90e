"""Sensitivities of executions: derivatives of states, transition times and outputs, through jumps.

`names` reads what is differentiated by, `overrides` puts the overrides of a run into the mathematics, `augment` writes
the system with its variational equations and saltation matrices as an ordinary hybrid system, and `result` reads the
derivatives off an execution of it.
"""
