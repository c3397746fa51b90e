"""``hsdsl.distance``: between two runs, or between two points of a model."""

from __future__ import annotations

import os
from typing import Any

from hsdsl.errors import UsageError
from hsdsl.execution import Execution
from hsdsl.metrics.interval import Interval
from hsdsl.metrics.points import Place


def distance(first: Any, second: Any, third: Any = None, **asked: Any) -> Interval:
    """Return how far apart two runs are, or two points of a model.

    Parameters
    ----------
    first, second : Execution
        Two runs of one model; further arguments as :func:`hsdsl.model.between_runs.distance` (``metric``,
        ``relaxation``, ``model``, ``parameters``, ``coordinates``).
    first : Model or path; second, third : str or Place
        A model and two of its points, as ``"free x=13 v=5"``; further arguments as :meth:`hsdsl.Model.distance`
        (``metric``, ``relaxation``, ``parameters``, ``hops``).

    Returns
    -------
    Interval
        What the distance is at least and at most; :meth:`hsdsl.Model.distance` also says the path, and
        that function the time.

    Raises
    ------
    UsageError
        The arguments are neither, or do not fit the model.
    """
    from hsdsl.model import Model, load
    from hsdsl.model.between_runs import distance as between_runs

    if isinstance(first, Execution) and isinstance(second, Execution) and third is None:
        return between_runs(first, second, **asked).interval
    model = load(first) if isinstance(first, (str, os.PathLike)) else first  # pyright: ignore[reportUnknownArgumentType]
    if isinstance(model, Model) and isinstance(second, (str, Place)) and isinstance(third, (str, Place)):
        return model.distance(second, third, **asked).interval
    raise UsageError(
        "distance takes two runs, or a model and two of its points",
        'for example distance(run, other) or distance(model, "free x=13 v=5", "free x=13 v=-4")',
    )
