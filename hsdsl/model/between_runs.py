"""The distance between two runs of a model, the model being read again where its space is needed."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from hsdsl.errors import UsageError
from hsdsl.execution import Execution
from hsdsl.metrics.curves import CurveDistance, PointMetric
from hsdsl.metrics.table import Request, between

if TYPE_CHECKING:
    from hsdsl.model import Model


def distance_of_runs(
    run: Execution,
    other: Execution,
    metric: str = "rho",
    *,
    relaxation: float | None = None,
    model: Model | str | os.PathLike[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    coordinates: Sequence[str] | None = None,
) -> CurveDistance:
    """Return how far apart two runs of one model are.

    Parameters
    ----------
    run, other : Execution
        Of one model file; schemes, steps, engines, initial values and lengths may differ.
    metric : str
        A key of `hsdsl.metrics.table.CURVE_METRICS`.
    relaxation : float, optional
        For ``rho`` and ``relaxed``: how deep the strips of the relaxed space are.
    model : Model or path, optional
        The model that the space is made of; left out, the file that the first run names.
    parameters : mapping, optional
        Overrides the runs were made with. Runs do not record them, and the space is made of guards and resets at these
        values: runs whose parameters differ are compared in the space of these.
    coordinates : names, optional
        For ``rho-hat``: the states that count as the position.

    Returns
    -------
    CurveDistance

    Raises
    ------
    UsageError
        Runs of different models, no time in common, an unknown metric, or a model that cannot be found or was edited
        since.
    """

    def space(depth: float | None) -> PointMetric:
        return _space(run, model, parameters or {}, depth)

    return between(metric, Request(run, other, space, relaxation, coordinates))


def _space(
    run: Execution, model: Model | str | os.PathLike[str] | None, parameters: Mapping[str, Any], depth: float | None
) -> PointMetric:
    from hsdsl.arithmetic import FLOAT64
    from hsdsl.metrics.pointwise import SpaceMetric
    from hsdsl.metrics.space import make_space
    from hsdsl.model import Model
    from hsdsl.model.values import with_parameters

    given = model if isinstance(model, Model) else _load(run.model if model is None else model, run)
    if given.system.digest != run.digest:
        raise UsageError(
            f"{given.system.path} is not the model that the run is of, or was edited since",
            "run it again, or give the model as it was",
        )
    values = with_parameters(given._values(FLOAT64), parameters)  # pyright: ignore[reportPrivateUsage]
    return SpaceMetric(make_space(given.system, [float(v) for v in values.parameters]), depth)


def _load(path: str | os.PathLike[str], run: Execution) -> Model:
    from hsdsl.model import load

    if not os.path.exists(path):
        raise UsageError(f"the run is of {run.model}, which is not there: the distance needs the model")
    return load(path)
