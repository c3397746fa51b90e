"""Exact executions: references that owe nothing to the simulator, and refined runs for other models.

`references` finds the stored execution that solves a model as it is written; `refined` is for any other model: runs in
many digits, refined until they agree. Stored ones are made by ``models/references``, with a bound on their error.
"""

from hsdsl.analysis.exact.references import reference, start_of
from hsdsl.analysis.exact.refined import precise

__all__ = ["precise", "reference", "start_of"]
