"""Sensitivities of executions: derivatives of states, transition times and outputs, through jumps.

`targets` reads what is differentiated by, `overrides` puts the overrides of a run into the mathematics, `augment`
writes the system with its variational equations and saltation matrices as an ordinary hybrid system, and `result` reads
the derivatives off an execution of it, also as text and JSON. `ties` finds where no derivative exists.
"""
