"""Distances between executions by name: the function that computes each, and the options that it takes.

Other packages may add distances: functions of two executions, which return a number or a `CurveDistance`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean
from hsdsl.base.plugins import Table, function_expected

if TYPE_CHECKING:
    from hsdsl.analysis.metrics.curves import CurveDistance
    from hsdsl.analysis.metrics.points import SpaceMetric
    from hsdsl.engine.execution import Execution

SpaceMaker = Callable[[float | None], "SpaceMetric"]  # the model's, relaxed or not


# Modules are imported when the distance is computed: the command line needs the names alone.
_METRICS = "hsdsl.analysis.metrics."
CURVE_METRICS = Table[Callable[..., Any]](
    "metrics",
    {
        "rho": f"{_METRICS}curves:rho",  # over time, as one of the next two
        "quotient": f"{_METRICS}curves:rho",  # a strip's points count as the guard's
        "relaxed": f"{_METRICS}curves:rho",  # its strips as deep as the runs' own
        "rho-hat": f"{_METRICS}labelled:rho_hat",  # of states, at the first run's samples
        "sup": f"{_METRICS}labelled:sup_norm",  # largest difference of states, plus 1 in different modes
        "skorokhod": f"{_METRICS}labelled:skorokhod",  # the same under the best retiming, which is paid for
        "tau-epsilon": f"{_METRICS}labelled:tau_epsilon",  # closeness of hybrid arcs, jump by jump
    },
    function_expected("a function of two executions"),
)
# Which options of :func:`between` a distance takes.
TAKES: dict[str, tuple[str, ...]] = {
    "rho": ("relaxation", "hops"),
    "quotient": ("hops",),
    "relaxed": ("relaxation", "hops"),
    "rho-hat": ("coordinates",),
}
POINT_METRICS = ("quotient", "relaxed")  # those that are also between points


def between(
    metric: str,
    a: Execution,
    b: Execution,
    space: SpaceMaker,
    relaxation: float | None = None,
    coordinates: Sequence[str] | None = None,
    hops: int | None = None,
) -> CurveDistance:
    """Compute a distance between two executions by its name; refuse options that it does not take.

    Only distances that measure on it make the ``space``.
    """
    if metric not in CURVE_METRICS:
        raise UsageError(f"there is no distance '{metric}' between runs", did_you_mean(metric, tuple(CURVE_METRICS)))
    check_same_model(a, b)
    function, takes = CURVE_METRICS[metric], TAKES.get(metric, ())

    def taking(option: str) -> list[str]:
        return [name for name, options in TAKES.items() if option in options]

    if relaxation is not None and "relaxation" not in takes:
        raise UsageError(f"the distance '{metric}' has no relaxation", f"with one: {' or '.join(taking('relaxation'))}")
    if hops is not None and "hops" not in takes:
        raise UsageError(f"the distance '{metric}' has no paths", f"hops are for {', '.join(taking('hops'))}")
    if coordinates is not None and "coordinates" not in takes:
        raise UsageError(f"the distance '{metric}' takes all states; coordinates are for {taking('coordinates')[0]}")
    if "hops" in takes:
        if metric == "relaxed" and relaxation is None:
            relaxation = max(float(run.settings.get("relaxation") or 0.0) for run in (a, b))
        if relaxation is not None and not relaxation > 0:
            raise UsageError("the relaxed space needs a positive relaxation, and these runs have none")
        return replace(function(a, b, space(relaxation), relaxation=relaxation), metric=metric)
    found = function(a, b, *(coordinates for _ in takes))
    return replace(found if hasattr(found, "lower") else _of_number(float(found), a, b), metric=metric)


def _of_number(distance: float, a: Execution, b: Execution) -> CurveDistance:
    """The number of another package's distance; nothing is known of how it was found."""
    from hsdsl.analysis.metrics.curves import CurveDistance
    from hsdsl.analysis.metrics.interval import SAMPLED, Interval

    if not distance >= 0:
        raise UsageError(f"expected a distance that is not negative, got {distance}")
    end = min(float(a.stop.time), float(b.stop.time))
    return CurveDistance(Interval(distance, distance, SAMPLED), None, "", (0.0, end))


def check_same_model(a: Execution, b: Execution) -> None:
    """Refuse runs of different models."""
    if a.digest != b.digest:
        raise UsageError(
            f"the runs are of different models ({a.model} and {b.model}, or an edited file): "
            "a distance is defined in one space only",
            "run both with one file: what differs is a parameter of it, as k or select(variant, a, b), given by "
            "--set variant=1",
        )
