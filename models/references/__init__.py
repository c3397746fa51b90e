"""Generators of the exact executions in ``hsdsl/analysis/exact/stored``: equations by hand, solved without the simulator.

======================  =======================================================================================
`build`                 the executions of each model; solves them and writes them
`bouncing_ball`         flights between bounces, by formula
`digital_control`       straight lines through four quadrants, by formula
`impact_oscillator`     the forced oscillator with a stop: impacts, Zeno points, rest
`oscillators`           its two examples (Table I) as executions
`stiff_switch`          a stiff model of two states with switching, by formula
`thermostat`            exponentials between two temperatures, by formula
`gallery`               the scenes of the gallery; its balls, swings and series are in `gallery_balls`, ...
`terms`                 solutions of linear flows, with bounds on their derivatives
`rests`                 the end of a Zeno tail, and rest
`constrained_pendulum`  a pendulum caught by a pin, by series
`pronking_runner`       the pronking runner, by series
`by_series`             a solution by series as an execution
`taylor`                smooth hybrid systems by Taylor series
`series`                power series
======================  =======================================================================================
"""
