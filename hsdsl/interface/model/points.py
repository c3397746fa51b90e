"""Points of a model's space, written as ``free x=13 v=5``, and the distance between two of them."""

from __future__ import annotations

import os
import re
from typing import Any

import numpy as np

from hsdsl.analysis.metrics.geometry import TOLERANCE, Space
from hsdsl.analysis.metrics.interval import Budget
from hsdsl.analysis.metrics.points import PointDistance, SpacePoint, coordinates, distance
from hsdsl.analysis.metrics.space import make_space
from hsdsl.analysis.metrics.table import CURVE_METRICS, POINT_METRICS
from hsdsl.base.defaults import DEFAULTS, least_relaxation
from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean
from hsdsl.engine.preparation.values import Values
from hsdsl.engine.simulate.stops import show
from hsdsl.interface.model.distances import check_hops

_ASSIGNMENT = re.compile(r"([^\W\d]\w*)\s*=(?!=)")


def distance_of_points(
    values: Values,
    p: str | SpacePoint,
    q: str | SpacePoint,
    metric: str,
    relaxation: Any,
    hops: int | None,
    budget: Budget,
    plot: str | os.PathLike[str] | None = None,
) -> PointDistance:
    """Return how far apart two points of a model's space are; see `Model.distance`."""
    if metric not in POINT_METRICS and metric in CURVE_METRICS:
        raise UsageError(
            f"'{metric}' is a distance between runs, not between points",
            f"between points: {' or '.join(POINT_METRICS)}",
        )
    if metric not in POINT_METRICS:
        raise UsageError(f"there is no distance '{metric}' between points", did_you_mean(metric, POINT_METRICS))
    if metric == "quotient" and relaxation is not None:
        raise UsageError("the quotient distance has no relaxation", "ask for the metric 'relaxed'")
    depth = None if metric == "quotient" else _relaxation(values, relaxation)
    check_hops(hops)
    space = make_space(values.system, [float(v) for v in values.parameters])
    start, end = (read_point(values, space, given) if isinstance(given, str) else given for given in (p, q))
    try:
        _check_inside(space, start, end)
        budget.start()
        result = distance(space, start, end, depth, hops, budget)
    except ValueError as error:
        raise UsageError(str(error)) from error
    if plot is not None:
        from hsdsl.analysis.plot.analyses import plot_path

        plot_path(plot, space, result.path, f"Shortest path, length {result.interval.upper:.6g}")
    return result


def read_point(values: Values, space: Space, text: str) -> SpacePoint:
    """Read ``MODE STATE=VALUE ...``; values are expressions of parameters.

    Raises UsageError: it is not of that form, names no mode, or does not give every state once.
    """
    mode, _, rest = text.strip().partition(" ")
    if mode not in space.modes:
        raise UsageError(f"'{text}': the model has no mode '{mode}'", did_you_mean(mode, space.modes))
    names = space.domains[space.mode_index(mode)].coordinates
    example = "for example: " + " ".join([mode, *(f"{name}=0" for name in names)])
    before, *parts = _ASSIGNMENT.split(rest)
    if before.strip():
        raise UsageError(f"'{text}': after the mode come its states, as NAME=VALUE", example)
    given: dict[str, str] = {}
    for name, value in zip(parts[::2], parts[1::2], strict=True):
        if name in given:
            raise UsageError(f"'{text}': {name} is given twice")
        if name == "t" and not space.timed:
            sentence = "time is no coordinate here, since no guard or reset depends on it"
            raise UsageError(f"'{text}': {sentence}", "leave out t")
        if name not in names:
            raise UsageError(f"'{text}': mode {mode} has no state '{name}'", did_you_mean(name, names))
        given[name] = value.strip().rstrip(",").strip()
    if missing := [name for name in names if name not in given]:
        raise UsageError(f"'{text}': no value is given for {', '.join(missing)}", example)
    numbers = [float(values.number(given[name], f"{mode} {name}")) for name in names]
    return SpacePoint(mode, tuple(numbers[:-1]), t=numbers[-1]) if space.timed else SpacePoint(mode, tuple(numbers))


def _relaxation(values: Values, given: Any) -> float:
    if given is None and values.has("relaxation"):
        given = values.constant("relaxation")[0]
    elif given is None:
        given = least_relaxation(float(DEFAULTS["relaxation"]), float(values.constant("until")[0]))
    number = float(values.number(given, "relaxation"))
    if number <= 0:
        raise UsageError(f"relaxation must be positive, not {show(number)}")
    return number


def _check_inside(space: Space, *places: SpacePoint) -> None:
    """Refuse points that are in no domain: the distance is between points of the space."""
    points = [coordinates(space, place) for place in places]
    size = max(float(np.linalg.norm(x)) for _, x in points)
    for place, (mode, x) in zip(places, points, strict=True):
        domain = space.domains[mode]
        excess, text = domain.excess(x, size)
        if not excess <= TOLERANCE:
            at = ", ".join(f"{n} = {show(v)}" for n, v in zip(domain.coordinates, x.tolist(), strict=True))
            beyond = f"where `{text}` has no value" if np.isnan(excess) else f"beyond `{text}`"
            raise UsageError(f"{at} is not in the domain of mode {place.mode}: it is {beyond}")
