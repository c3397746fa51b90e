"""Distances between two runs, or between two points of a model, written as ``free x=13 v=5``.

A run names its model; that is read again where its space is needed. Runs from nearby test orbital stability.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from hsdsl.analysis.metrics.curves import CurveDistance
from hsdsl.analysis.metrics.geometry import TOLERANCE, Space
from hsdsl.analysis.metrics.interval import Budget
from hsdsl.analysis.metrics.points import PointDistance, SpaceMetric, SpacePoint, coordinates
from hsdsl.analysis.metrics.points import distance as shortest
from hsdsl.analysis.metrics.space import make_space
from hsdsl.analysis.metrics.table import CURVE_METRICS, POINT_METRICS, between, check_same_model
from hsdsl.analysis.orbits.sampling import OrbitalStability, directions, sampled
from hsdsl.base.defaults import DEFAULTS, least_relaxation
from hsdsl.base.errors import UsageError
from hsdsl.base.names import called, checks_arguments, did_you_mean
from hsdsl.engine.execution import Execution
from hsdsl.engine.preparation.options import check_arguments, overrides_of, parameters_of
from hsdsl.engine.preparation.pipeline import pipeline_of
from hsdsl.engine.preparation.values import Values, whole
from hsdsl.engine.simulate.stops import show
from hsdsl.interface.model.differentiate import LOCATED_ALONE, located_arguments, start_by, varied
from hsdsl.interface.model.runs import Runs

SECONDS = 60.0  # that a search may take, by default


@checks_arguments
def distance_of_runs(
    run: Execution,
    other: Execution,
    metric: str = "rho",
    *,
    relaxation: Any = None,
    model: Runs | str | os.PathLike[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    coordinates: Sequence[str] | None = None,
    hops: int | None = None,
    seconds: float = SECONDS,
    watch: Callable[[float, float], None] | None = None,
) -> CurveDistance:
    """Return the distance of two runs of one model.

    Parameters
    ----------
    run, other : Execution
        Runs of one model file; schemes, steps, engines, initial values and lengths may differ.
    metric : str
        A key of `table.CURVE_METRICS`: rho, quotient, relaxed, rho-hat, sup, skorokhod or tau-epsilon.
    relaxation : number or str, optional
        For ``rho`` and ``relaxed``: the depth of the strips of the relaxed space.
    model : Model or path, optional
        The model that defines the space; by default the file that the first run names.
    parameters : mapping, optional
        Overrides by name, beyond those of the first run, for the guards and resets of the space. If the second run has
        other values, the note says so.
    coordinates : names, optional
        For ``rho-hat``: the states that count as the position.
    hops : int, optional
        For ``rho``, ``quotient`` and ``relaxed``: the largest number of passages of a path; by default eight more than
        the fewest that connect the modes. The lower end also holds for paths with more.
    seconds : float
        For ``rho``, ``quotient`` and ``relaxed``: the time limit of the search. If it is reached, the interval is
        wider, and the note says so.
    watch : callable, optional
        Called from time to time with the present bounds, for those three.

    Raises UsageError: runs of different models, no time in common, an unknown metric, or a model that is missing or was
    edited since.
    """
    check_hops(hops)
    source = _RunSpace(run, other, model, parameters, budget_of(seconds, watch), hops)
    depth = None if relaxation is None else source.depth(relaxation)
    result = between(metric, run, other, source.space, depth, coordinates, hops)
    return replace(result, note="\n".join(filter(None, (result.note, source.note))))


def plot_distance(
    run: Execution,
    other: Execution,
    path: str | os.PathLike[str],
    *,
    relaxation: Any = None,
    model: Runs | str | os.PathLike[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    hops: int | None = None,
    seconds: float = SECONDS,
) -> None:
    """Draw the distance of two runs over time, and the difference of their states; see :func:`distance_of_runs`.

    After ``seconds`` the remaining times have wide bounds.
    """
    from hsdsl.analysis.metrics.labelled import profiles
    from hsdsl.analysis.plot.analyses import plot_over_time

    check_same_model(run, other)
    source = _RunSpace(run, other, model, parameters, budget_of(seconds), hops)
    depth = None if relaxation is None else source.depth(relaxation)
    curves = profiles(run, other, source.space(depth), depth)
    labels = {"rho": "in the quotient" if depth is None else "in the relaxed space", "sup": "of states and modes"}
    bounds = {labels[name]: (profile.lower, profile.upper) for name, profile in curves.items()}
    plot_over_time(path, curves["rho"].times, bounds, f"Distance over time: {called(run.title, run.model)}")


def budget_of(seconds: float, watch: Callable[[float, float], None] | None = None) -> Budget:
    """A budget of a positive number of seconds that begins now."""
    if not seconds > 0:
        raise UsageError(f"a distance needs a positive number of seconds, not {seconds:g}")
    return Budget(seconds, watch=watch)


def check_hops(hops: int | None) -> None:
    """Refuse a number of passages that is negative or no whole number."""
    if hops is not None and not (hops >= 0 and hops == int(hops)):
        raise UsageError(f"hops must be a whole number, not {hops}")


@dataclass
class _RunSpace:
    """The space of a run's model, read when first needed; ``note`` has parameters that differ in the other run."""

    run: Execution
    other: Execution
    model: Runs | str | os.PathLike[str] | None
    parameters: Mapping[str, Any] | None
    budget: Budget
    hops: int | None
    note: str = ""

    @cached_property
    def values(self) -> Values:
        model = self.model if isinstance(self.model, Runs) else _load(self.model, self.run)
        if model.system.digest != self.run.digest:
            raise UsageError(
                f"{model.system.path} is not the model that the run is of, or was edited since",
                "run it again, or give the model as it was",
            )
        if "auto" in (run.settings.get("completion") for run in (self.run, self.other)):
            model = model.sliding
        first, second = (parameters_of(run.overrides) | dict(self.parameters or {}) for run in (self.run, self.other))
        values = model.pipeline.values(parameters=first)
        if first != second:
            self.note = _differences(values, model.pipeline.values(parameters=second))
        return values

    def depth(self, relaxation: Any) -> float:
        number = float(self.values.number(relaxation, "relaxation") if isinstance(relaxation, str) else relaxation)
        if not number > 0:
            raise UsageError(f"relaxation must be positive, not {number:.10g}")
        return number

    def space(self, depth: float | None) -> SpaceMetric:
        from hsdsl.analysis.metrics.space import make_space
        from hsdsl.language.elaborate.derived import flat_part

        visited = dict.fromkeys(arc.mode for run in (self.run, self.other) for arc in run.arcs)
        system = flat_part(self.values.system, visited)
        space = make_space(system, [float(v) for v in self.values.parameters])
        self.budget.start()
        return SpaceMetric(space, depth, self.budget, self.hops)


def _differences(first: Values, second: Values) -> str:
    """A sentence with the parameters that have different values in two runs."""
    pairs = zip(first.program.parameters, first.parameters, second.parameters, strict=True)
    apart = [f"{name} = {show(one)} and {show(two)}" for name, one, two in pairs if one != two]
    if not apart:
        return ""
    return f"The runs have different parameters ({', '.join(apart)}): guards and resets are those of the first."


def _load(path: str | os.PathLike[str] | None, run: Execution) -> Runs:
    if path is None and not os.path.exists(run.model):
        raise UsageError(
            f"the run is of {run.model}, which is not there: the distance needs the model", "give it as model="
        )
    return Runs(pipeline_of(run.model if path is None else path, None))


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
    """Return the distance between two points of a model's space; see `Model.distance`."""
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
        result = shortest(space, start, end, depth, hops, budget)
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


def orbital_stability(
    model: Runs,
    wrt: str | Sequence[str] | None,
    radii: Sequence[float],
    samples: int,
    seed: int,
    progress: Callable[[int, int], None] | None,
    arguments: Mapping[str, Any],
) -> OrbitalStability:
    """Test an execution; see `Model.orbital_stability`."""
    check_arguments(arguments, "a stability test", LOCATED_ALONE)
    if len(radii) < 2 or not all(0 < b < a for a, b in pairwise(radii)):
        raise UsageError(f"expected at least two radii that fall, got {', '.join(map(str, radii))}")
    call = located_arguments(model.pipeline, arguments)
    values = model.pipeline.values(parameters=overrides_of(call, "parameters", model.program))
    by, known = start_by(wrt, call, values)
    run = model.simulate(**call)
    sizes = run.sizes()
    scales = np.array([abs(known[t.label]) or sizes.get(t.name, 0.0) or 1.0 for t in by])
    ways = directions(len(by), whole(samples, "samples", 1), seed)
    total, done = len(radii) * len(ways), 0

    def moved_run(shift: Mapping[str, float]) -> tuple[float, float, tuple[str, ...]]:
        nonlocal done
        moved = {label: number + shift[label] for label, number in known.items()}
        other = model.simulate(**varied(call, by, moved, model.program))
        found = inf, inf  # of a run that stops for another reason
        if run.stop.reason == other.stop.reason:
            apart = distance_of_runs(run, other, model=model).interval
            found = float(apart.lower), float(apart.upper)
        done += 1
        if progress is not None:
            progress(done, total)
        return (*found, tuple(made.edge for made in other.transitions))

    title = called(run.title, run.model)
    return sampled([t.label for t in by], scales, list(radii), ways, moved_run, title)
