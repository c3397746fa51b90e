"""The table of distances between executions: a name, the function that computes it, and the options that it takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean

if TYPE_CHECKING:
    from hsdsl.analysis.metrics.curves import CurveDistance
    from hsdsl.analysis.metrics.points import SpaceMetric
    from hsdsl.engine.execution import Execution

SpaceMaker = Callable[[float | None], "SpaceMetric"]  # the model's, relaxed or not


@dataclass(frozen=True)
class CurvePair:
    """Two runs and what else a distance may need; only those that measure on it make the ``space``."""

    a: Execution
    b: Execution
    space: SpaceMaker
    relaxation: float | None = None
    coordinates: Sequence[str] | None = None
    hops: int | None = None


@dataclass(frozen=True)
class CurveMetric:
    """A distance: its function, in a module of `metrics`, and which fields of a pair it takes beyond the runs.

    The module is imported when the distance is computed: the command line needs the names alone.
    """

    module: str
    function: str
    takes: tuple[str, ...] = ()

    def __call__(self, pair: CurvePair) -> CurveDistance:
        """Compute the distance."""
        function = getattr(import_module(f"hsdsl.analysis.metrics.{self.module}"), self.function)
        if "hops" in self.takes:
            depth = _depth(pair) if self.relaxed(pair) else None
            return function(pair.a, pair.b, pair.space(depth), relaxation=depth)
        return function(pair.a, pair.b, *(getattr(pair, name) for name in self.takes))

    def relaxed(self, pair: CurvePair) -> bool:
        """Whether it measures on the relaxed space: always, or where the pair has a relaxation."""
        return "relaxation" in self.takes and (pair.relaxation is not None or self is CURVE_METRICS["relaxed"])


def _depth(pair: CurvePair) -> float:
    relaxation = pair.relaxation
    if relaxation is None:
        relaxation = max(float(run.settings.get("relaxation") or 0.0) for run in (pair.a, pair.b))
    if not relaxation > 0:
        raise UsageError("the relaxed space needs a positive relaxation, and these runs have none")
    return relaxation


CURVE_METRICS = {
    "rho": CurveMetric("curves", "rho", ("relaxation", "hops")),  # over time, as one of the next two
    "quotient": CurveMetric("curves", "rho", ("hops",)),  # a strip's points count as the guard's
    "relaxed": CurveMetric("curves", "rho", ("relaxation", "hops")),  # its strips as deep as the runs' own
    "rho-hat": CurveMetric("labelled", "rho_hat", ("coordinates",)),  # of states, at the first run's samples
    "sup": CurveMetric("labelled", "sup_norm"),  # largest difference of states, plus 1 in different modes
    "skorokhod": CurveMetric("labelled", "skorokhod"),  # the same under the best retiming, which is paid for
    "tau-epsilon": CurveMetric("labelled", "tau_epsilon"),  # closeness of hybrid arcs, jump by jump
}
POINT_METRICS = ("quotient", "relaxed")  # those that are also between points


def _taking(option: str) -> list[str]:
    return [name for name, metric in CURVE_METRICS.items() if option in metric.takes]


def between(metric: str, request: CurvePair) -> CurveDistance:
    """Compute a distance between two executions by its name; refuse options that it does not take."""
    if metric not in CURVE_METRICS:
        raise UsageError(f"there is no distance '{metric}' between runs", did_you_mean(metric, tuple(CURVE_METRICS)))
    check_same_model(request.a, request.b)
    takes = CURVE_METRICS[metric].takes
    if request.relaxation is not None and "relaxation" not in takes:
        raise UsageError(
            f"the distance '{metric}' has no relaxation", f"with one: {' or '.join(_taking('relaxation'))}"
        )
    if request.hops is not None and "hops" not in takes:
        raise UsageError(f"the distance '{metric}' has no paths", f"hops are for {', '.join(_taking('hops'))}")
    if request.coordinates is not None and "coordinates" not in takes:
        raise UsageError(f"the distance '{metric}' takes all states; coordinates are for {_taking('coordinates')[0]}")
    return replace(CURVE_METRICS[metric](request), metric=metric)


def check_same_model(a: Execution, b: Execution) -> None:
    """Refuse runs of different models."""
    if a.digest != b.digest:
        raise UsageError(
            f"the runs are of different models ({a.model} and {b.model}, or an edited file): "
            "a distance is defined in one space only",
            "run both with one file: what differs is a parameter of it, as k or select(variant, a, b), given by "
            "--set variant=1",
        )
