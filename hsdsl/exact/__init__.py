"""Exact executions: closed forms of the paper's scenes and others, as executions like any run's.

They owe nothing to the simulator: each is solved by formula in eighty digits and cut into polynomial pieces
(`hsdsl.exact.pieces`); ``settings`` hold a bound on the error at any time, ``error``, with what it rests on,
``source``. `precise` is for the other models: a refined run, and an estimate of its error.

==================  ===========================================================================================
`pieces`            stretches between jumps -> polynomial pieces of a known error -> Execution
`tails`             the end of a Zeno tail, and rest
`stop`              the oscillator with a stop, solved
`oscillators`       its two examples as executions
`ball`              a bouncing ball
`heater`            a thermostat
`quadrants`         the digital control system
`refined`           any other model: runs in many digits, refined until they agree
`numbers`           the numbers of eighty digits
==================  ===========================================================================================
"""

from hsdsl.exact.ball import bouncing_ball
from hsdsl.exact.heater import thermostat
from hsdsl.exact.oscillators import oscillator
from hsdsl.exact.quadrants import digital_control
from hsdsl.exact.refined import precise

__all__ = ["bouncing_ball", "digital_control", "oscillator", "precise", "thermostat"]
