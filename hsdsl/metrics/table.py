"""The table of distances between executions: a name, and the function that computes it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from hsdsl.errors import UsageError
from hsdsl.execution import Execution
from hsdsl.metrics.curves import CurveDistance, rho
from hsdsl.metrics.labelled_sup import rho_hat, sup_norm
from hsdsl.metrics.points import SpaceMetric
from hsdsl.metrics.skorokhod import skorokhod
from hsdsl.metrics.tau_epsilon import tau_epsilon
from hsdsl.names import did_you_mean

SpaceMaker = Callable[[float | None], SpaceMetric]  # the model's, relaxed or not


@dataclass(frozen=True)
class CurvePair:
    """Two runs and what else a distance may need; ``space`` is asked for only by those that measure on it."""

    a: Execution
    b: Execution
    space: SpaceMaker
    relaxation: float | None = None
    coordinates: Sequence[str] | None = None
    hops: int | None = None


def _quotient(request: CurvePair) -> CurveDistance:
    return rho(request.a, request.b, request.space(None))


def _relaxed(request: CurvePair) -> CurveDistance:
    relaxation = request.relaxation
    if relaxation is None:
        relaxation = max(float(run.settings.get("relaxation") or 0.0) for run in (request.a, request.b))
    if not relaxation > 0:
        raise UsageError("the relaxed space needs a positive relaxation, and these runs have none")
    return rho(request.a, request.b, request.space(relaxation), relaxation=relaxation)


def _rho(request: CurvePair) -> CurveDistance:
    return _quotient(request) if request.relaxation is None else _relaxed(request)


CURVE_METRICS: dict[str, Callable[[CurvePair], CurveDistance]] = {
    "rho": _rho,  # largest quotient distance over time; with a relaxation, on the relaxed space
    "quotient": _quotient,  # the same on the quotient space, a strip's points counting as the guard's
    "relaxed": _relaxed,  # the same on the relaxed space, its strips as deep as the runs' own
    "rho-hat": lambda r: rho_hat(r.a, r.b, r.coordinates),  # largest difference of states at the first run's samples
    "sup": lambda r: sup_norm(r.a, r.b),  # largest difference of states, plus 1 in different modes
    "skorokhod": lambda r: skorokhod(r.a, r.b),  # the same under the best retiming, which is paid for
    "tau-epsilon": lambda r: tau_epsilon(r.a, r.b),  # closeness of hybrid arcs, jump by jump
}

RELAXED = ("rho", "relaxed")
ON_THE_SPACE = ("rho", "quotient", "relaxed")


def between(metric: str, request: CurvePair) -> CurveDistance:
    """Compute a distance between two executions by its name; refuse options that it does not take."""
    if metric not in CURVE_METRICS:
        raise UsageError(f"there is no distance '{metric}' between runs", did_you_mean(metric, tuple(CURVE_METRICS)))
    check_same_model(request.a, request.b)
    if request.relaxation is not None and metric not in RELAXED:
        raise UsageError(f"the distance '{metric}' has no relaxation", f"with one: {' or '.join(RELAXED)}")
    if request.hops is not None and metric not in ON_THE_SPACE:
        raise UsageError(f"the distance '{metric}' has no paths", f"hops are for {', '.join(ON_THE_SPACE)}")
    if request.coordinates is not None and metric != "rho-hat":
        raise UsageError(f"the distance '{metric}' takes all states; coordinates are for rho-hat")
    return replace(CURVE_METRICS[metric](request), metric=metric)


def check_same_model(a: Execution, b: Execution) -> None:
    """Refuse runs of different models."""
    if a.digest != b.digest:
        raise UsageError(
            f"the runs are of different models ({a.model} and {b.model}, or an edited file): "
            "a distance is defined in one space only",
            "run both again with the same model file",
        )
