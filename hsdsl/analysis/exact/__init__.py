"""Exact executions: references that owe nothing to the simulator, and refined runs for other models.

`references` finds the stored execution that solves a model as it is written; `interpolation` makes polynomial pieces of
formulas, with a bound on their error; `refined` is for any other model: runs in many digits, refined until they agree.
"""

from hsdsl.analysis.exact.references import reference, start_of
from hsdsl.analysis.exact.refined import precise

__all__ = ["precise", "reference", "start_of"]
