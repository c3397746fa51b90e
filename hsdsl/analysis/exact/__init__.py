"""Exact executions: references that owe nothing to the simulator, and refined runs for other models.

==================  ===========================================================================================
`references`        the stored execution that solves a model
`residual`          whether an execution solves a model as it is written
`interpolation`     a stretch of a formula as polynomial pieces with a bound on their error
`refined`           any other model: runs in many digits, refined until they agree
==================  ===========================================================================================
"""

from hsdsl.analysis.exact.references import reference, start_of
from hsdsl.analysis.exact.refined import precise

__all__ = ["precise", "reference", "start_of"]
