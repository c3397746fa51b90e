"""``hsdsl.distance``: between two runs, or between two points of a model.

A run names its model; that is read again where its space is needed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from hsdsl.analysis.metrics.budget import Budget
from hsdsl.analysis.metrics.curves import CurveDistance
from hsdsl.analysis.metrics.interval import Interval
from hsdsl.analysis.metrics.points import SpaceMetric, SpacePoint
from hsdsl.analysis.metrics.table import CurvePair, between, check_same_model
from hsdsl.base.errors import UsageError
from hsdsl.base.names import called, checks_arguments
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.execution import Execution
from hsdsl.engine.preparation.options import parameters_of
from hsdsl.engine.simulate.stops import show

if TYPE_CHECKING:
    from hsdsl.engine.preparation.values import Values
    from hsdsl.interface.model import Model

SECONDS = 60.0  # that a search may take, by default


def distance(first: Any, second: Any, third: Any = None, **arguments: Any) -> Interval:
    """Return how far apart two runs are, or two points of a model.

    Parameters
    ----------
    first : Execution, Model or path
        One of two runs of a model; or a model, of two of its points.
    second : Execution, str or SpacePoint
        The other run; or a point, as ``"free x=13 v=5"``.
    third : str or SpacePoint, optional
        The other point.
    **arguments
        Further ones of :func:`distance_of_runs`, or of :meth:`hsdsl.Model.distance`.

    The interval has the least and the largest possible distance; :meth:`hsdsl.Model.distance` also has the path, and
    that function the time.

    Raises UsageError: the arguments are neither, or do not fit the model.
    """
    from hsdsl.interface.model import Model, load

    if isinstance(first, Execution) and isinstance(second, Execution) and third is None:
        return distance_of_runs(first, second, **arguments).interval
    model = load(first) if isinstance(first, (str, os.PathLike)) else first  # pyright: ignore[reportUnknownArgumentType]
    if isinstance(model, Model) and isinstance(second, (str, SpacePoint)) and isinstance(third, (str, SpacePoint)):
        return model.distance(second, third, **arguments).interval
    raise UsageError(
        "distance takes two runs, or a model and two of its points",
        'for example distance(run, other) or distance(model, "free x=13 v=5", "free x=13 v=-4")',
    )


@checks_arguments
def distance_of_runs(
    run: Execution,
    other: Execution,
    metric: str = "rho",
    *,
    relaxation: Any = None,
    model: Model | str | os.PathLike[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    coordinates: Sequence[str] | None = None,
    hops: int | None = None,
    seconds: float = SECONDS,
    watch: Callable[[float, float], None] | None = None,
) -> CurveDistance:
    """Return how far apart two runs of one model are.

    Parameters
    ----------
    run, other : Execution
        Of one model file; schemes, steps, engines, initial values and lengths may differ.
    metric : str
        A key of `table.CURVE_METRICS`: rho, quotient, relaxed, rho-hat, sup, skorokhod or tau-epsilon.
    relaxation : number or str, optional
        For ``rho`` and ``relaxed``: how deep the strips of the relaxed space are.
    model : Model or path, optional
        The model that the space is made of; left out, the file that the first run names.
    parameters : mapping, optional
        Overrides by name, beyond those of the first run: the space has guards and resets at these values. Where the
        second run has others, the note says so.
    coordinates : names, optional
        For ``rho-hat``: the states that count as the position.
    hops : int, optional
        For ``rho``, ``quotient`` and ``relaxed``: the most passages of a path; left out, eight more than the fewest
        that connect the modes. The lower end holds for paths with more, too.
    seconds : float
        For ``rho``, ``quotient`` and ``relaxed``: the time for the search. After it the interval is wider, and the note
        says so.
    watch : callable, optional
        Called now and then with the bounds so far, for those three.

    Raises UsageError: runs of different models, no time in common, an unknown metric, or a model that is missing or was
    edited since.
    """
    check_hops(hops)
    source = _RunSpace(run, other, model, parameters, budget_of(seconds, watch), hops)
    depth = None if relaxation is None else source.depth(relaxation)
    result = between(metric, CurvePair(run, other, source.space, depth, coordinates, hops))
    return replace(result, note="\n".join(filter(None, (result.note, source.note))))


def plot_distance(
    run: Execution,
    other: Execution,
    path: str | os.PathLike[str],
    *,
    relaxation: Any = None,
    model: Model | str | os.PathLike[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    hops: int | None = None,
    seconds: float = SECONDS,
) -> None:
    """Draw the distance of two runs over time, and the difference of their states; see :func:`distance_of_runs`.

    After ``seconds`` the remaining times have wide bounds.
    """
    from hsdsl.analysis.metrics.profile import profiles
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
    model: Model | str | os.PathLike[str] | None
    parameters: Mapping[str, Any] | None
    budget: Budget
    hops: int | None
    note: str = ""

    @cached_property
    def values(self) -> Values:
        from hsdsl.engine.preparation.values import with_parameters
        from hsdsl.interface.model import Model

        model = self.model if isinstance(self.model, Model) else _load(self.model, self.run)
        if model.system.digest != self.run.digest:
            raise UsageError(
                f"{model.system.path} is not the model that the run is of, or was edited since",
                "run it again, or give the model as it was",
            )
        if "auto" in (run.settings.get("completion") for run in (self.run, self.other)):
            model = model.sliding
        first, second = (parameters_of(run.overrides) | dict(self.parameters or {}) for run in (self.run, self.other))
        plain = model.pipeline.values(FLOAT64)
        values = with_parameters(plain, first)
        if first != second:
            self.note = _differences(values, with_parameters(plain, second))
        return values

    def depth(self, relaxation: Any) -> float:
        number = float(self.values.number(relaxation, "relaxation") if isinstance(relaxation, str) else relaxation)
        if not number > 0:
            raise UsageError(f"relaxation must be positive, not {number:.10g}")
        return number

    def space(self, depth: float | None) -> SpaceMetric:
        from hsdsl.analysis.metrics.space import make_space
        from hsdsl.language.elaborate.product import flat_part

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


def _load(path: str | os.PathLike[str] | None, run: Execution) -> Model:
    from hsdsl.interface.model import load

    if path is None and not os.path.exists(run.model):
        raise UsageError(
            f"the run is of {run.model}, which is not there: the distance needs the model", "give it as model="
        )
    return load(run.model if path is None else path)
