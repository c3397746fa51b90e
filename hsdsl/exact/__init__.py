"""Exact executions: closed forms of the paper's scenes and others, as executions like any run's.

They owe nothing to the simulator: each is solved by formula in eighty digits, or by Taylor series in as many, and cut
into polynomial pieces (`hsdsl.exact.pieces`); ``settings`` hold a bound on the error at any time, ``error``, with what
it rests on, ``source``. `reference` gives the one that belongs to a model. `precise` is for models that have none: a
refined run, and an estimate of its error.

==================  ===========================================================================================
`references`        which execution belongs to a model; those stored beside it
`residual`          whether an execution solves a model as it is written
`scene`             stretches of a formula between jumps
`interpolation`     a stretch as polynomial pieces of a known error
`pieces`            stretches -> Execution
`tails`             the end of a Zeno tail, and rest
`stop`              the oscillator with a stop, solved
`oscillators`       its two examples as executions
`ball`              a bouncing ball
`heater`            a thermostat
`stiff_switch`      a stiff model of two states with switching
`quadrants`         the digital control system
`pendulum`          a pendulum caught by a pin, by series
`runner`            the pronking runner, by series
`by_series`         a solution by series as an execution
`taylor`            smooth hybrid systems by Taylor series
`series`            power series
`refined`           any other model: runs in many digits, refined until they agree
`numbers`           the numbers of eighty digits
==================  ===========================================================================================
"""

from hsdsl.exact.ball import bouncing_ball
from hsdsl.exact.heater import thermostat
from hsdsl.exact.oscillators import oscillator
from hsdsl.exact.pendulum import constrained_pendulum
from hsdsl.exact.quadrants import digital_control
from hsdsl.exact.references import reference
from hsdsl.exact.refined import precise
from hsdsl.exact.runner import pronking_runner
from hsdsl.exact.stiff_switch import stiff_switch

__all__ = [
    "bouncing_ball",
    "constrained_pendulum",
    "digital_control",
    "oscillator",
    "precise",
    "pronking_runner",
    "reference",
    "stiff_switch",
    "thermostat",
]
