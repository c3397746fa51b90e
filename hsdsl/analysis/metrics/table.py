"""Distances between executions by name: the function that computes each, and the options that it takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean

if TYPE_CHECKING:
    from hsdsl.analysis.metrics.curves import CurveDistance
    from hsdsl.analysis.metrics.points import SpaceMetric
    from hsdsl.engine.execution import Execution

SpaceMaker = Callable[[float | None], "SpaceMetric"]  # the model's, relaxed or not


class CurvePair(NamedTuple):
    """Two runs and what else a distance may need; only those that measure on it make the ``space``."""

    a: Execution
    b: Execution
    space: SpaceMaker
    relaxation: float | None = None
    coordinates: Sequence[str] | None = None
    hops: int | None = None


# Names: the function that computes it, and which fields of a pair it takes beyond the runs. Modules are imported when
# the distance is computed: the command line needs the names alone.
CURVE_METRICS: dict[str, tuple[str, tuple[str, ...]]] = {
    "rho": ("curves.rho", ("relaxation", "hops")),  # over time, as one of the next two
    "quotient": ("curves.rho", ("hops",)),  # a strip's points count as the guard's
    "relaxed": ("curves.rho", ("relaxation", "hops")),  # its strips as deep as the runs' own
    "rho-hat": ("labelled.rho_hat", ("coordinates",)),  # of states, at the first run's samples
    "sup": ("labelled.sup_norm", ()),  # largest difference of states, plus 1 in different modes
    "skorokhod": ("labelled.skorokhod", ()),  # the same under the best retiming, which is paid for
    "tau-epsilon": ("labelled.tau_epsilon", ()),  # closeness of hybrid arcs, jump by jump
}
POINT_METRICS = ("quotient", "relaxed")  # those that are also between points


def between(metric: str, request: CurvePair) -> CurveDistance:
    """Compute a distance between two executions by its name; refuse options that it does not take."""
    if metric not in CURVE_METRICS:
        raise UsageError(f"there is no distance '{metric}' between runs", did_you_mean(metric, tuple(CURVE_METRICS)))
    a, b, space, relaxation, coordinates, hops = request
    check_same_model(a, b)
    path, takes = CURVE_METRICS[metric]

    def taking(option: str) -> list[str]:
        return [name for name, (_, options) in CURVE_METRICS.items() if option in options]

    if relaxation is not None and "relaxation" not in takes:
        raise UsageError(f"the distance '{metric}' has no relaxation", f"with one: {' or '.join(taking('relaxation'))}")
    if hops is not None and "hops" not in takes:
        raise UsageError(f"the distance '{metric}' has no paths", f"hops are for {', '.join(taking('hops'))}")
    if coordinates is not None and "coordinates" not in takes:
        raise UsageError(f"the distance '{metric}' takes all states; coordinates are for {taking('coordinates')[0]}")
    module, _, name = path.partition(".")
    function = getattr(import_module(f"hsdsl.analysis.metrics.{module}"), name)
    if "hops" in takes:
        if metric == "relaxed" and relaxation is None:
            relaxation = max(float(run.settings.get("relaxation") or 0.0) for run in (a, b))
        if relaxation is not None and not relaxation > 0:
            raise UsageError("the relaxed space needs a positive relaxation, and these runs have none")
        return replace(function(a, b, space(relaxation), relaxation=relaxation), metric=metric)
    return replace(function(a, b, *(coordinates for _ in takes)), metric=metric)


def check_same_model(a: Execution, b: Execution) -> None:
    """Refuse runs of different models."""
    if a.digest != b.digest:
        raise UsageError(
            f"the runs are of different models ({a.model} and {b.model}, or an edited file): "
            "a distance is defined in one space only",
            "run both with one file: what differs is a parameter of it, as k or select(variant, a, b), given by "
            "--set variant=1",
        )
