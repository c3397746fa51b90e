"""The outcome of one run of a stability map, and known limits of linear stability.

A run is compared with a reference at the same numbers; tools are ours, without a name, or peers.

The limit is the largest step at which a method damps what a linear flow damps. A Runge-Kutta method multiplies the
solution of x' = lambda x by R(h lambda) in a step, with its stability function R(z) = 1 + z b (1 - z A)^-1 1 (Hairer
and Wanner 1996, Def. IV.2.1), a polynomial for an explicit method. It is stable at h where |R(h lambda)| <= 1 for every
eigenvalue lambda of the flow that does not grow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from math import inf, isfinite, nan
from typing import Any, NamedTuple

import numpy as np

from hsdsl.analysis.exact import reference
from hsdsl.base.defaults import NUMERICAL
from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Array, Execution
from hsdsl.engine.integrators import METHODS, ButcherTableau
from hsdsl.interface.chart.outcome import WITHIN, outcome, spans
from hsdsl.interface.chart.peers import prepare
from hsdsl.interface.chart.scene import NotFinite, Refused, Result, Scene, Tool
from hsdsl.interface.model import Model
from hsdsl.interface.model.distances import distance_of_runs

CONVERGED, INACCURATE, OTHER = "converged", "inaccurate", "wrong transitions"
BLOWN_UP, STUCK, REFUSED, UNKNOWN = "blown up", "stuck", "refused", "no reference"
WORDS = (CONVERGED, INACCURATE, OTHER, BLOWN_UP, STUCK, REFUSED, UNKNOWN)
LARGE = 10.0  # spans of a state: a run that goes farther has blown up
PRECISE = 1e-12  # the tolerance of a reference run
SAMPLES = 400
SECONDS, MOST_ROWS = 5.0, 25_000  # for rho, which longer runs do not get
LOOSE = 0.5  # of rho's upper bound: bounds farther apart than that say little
PEER_TOLERANCE = 1e-6
RAN_AWAY = ("not_finite", "left_domain")


class Cell(NamedTuple):
    """What came of a run: a word of :data:`WORDS`, ``rho`` (at most) or NaN, the error of samples, and why.

    Of converged runs samples near jumps of the reference do not count; of others times that are near are compared.
    """

    word: str
    rho: float = nan
    error: float = nan
    transitions: int | None = None
    why: str = ""


@dataclass
class Bench:
    """Runs of a model; references are kept by the numbers of a run.

    A model's exact execution is the reference where nothing but settings differs from the file; else it is a located
    run at a tolerance of 1e-12.
    """

    model: Model
    with_rho: bool
    scenes: dict[tuple[Any, ...], Scene | str] = field(default_factory=dict[tuple[Any, ...], "Scene | str"])

    @cached_property
    def exact(self) -> Execution | None:
        """The model's exact execution."""
        try:
            return reference(self.model)
        except UsageError:
            return None

    def run(self, tool: Tool, arguments: Mapping[str, Any]) -> Cell:
        """Run a tool with the arguments of `Model.simulate`."""
        scene = self.scene(arguments)
        if isinstance(scene, str):
            return Cell(UNKNOWN, why=scene)
        try:
            if not tool.name:
                return self._own(scene, tool, arguments)
            return _cell(scene, prepare(tool.name, scene)(arguments.get("tolerance", PEER_TOLERANCE)), "stopped")
        except UsageError as error:
            return Cell(REFUSED, why=str(error))
        except NotFinite as end:
            return Cell(BLOWN_UP, why=str(end))
        except Refused as refusal:
            return Cell(REFUSED, why=str(refusal))

    def scene(self, arguments: Mapping[str, Any]) -> Scene | str:
        """The reference at these numbers; a reason where there is none."""
        groups = ("parameters", "initial", "settings")
        given = {group: dict[str, Any](arguments.get(group) or {}) for group in groups}
        key = tuple((group, *sorted(numbers.items())) for group, numbers in given.items())
        if key not in self.scenes:
            self.scenes[key] = self._scene(given.pop("settings"), given)
        return self.scenes[key]

    def _scene(self, settings: dict[str, Any], numbers: dict[str, dict[str, Any]]) -> Scene | str:
        exact = self.exact if not any(numbers.values()) and not settings else None
        if exact is None:
            settings = {key: value for key, value in settings.items() if key not in NUMERICAL}
            try:
                given: dict[str, Any] = {"tolerance": PRECISE, "settings": settings, **numbers}
                exact = self.model.simulate(scheme="located", method="auto", **given)
            except UsageError as error:
                return str(error)
            if not exact.stop.complete:
                return f"the reference stops: {exact.stop.message}"
        end = float(exact.stop.time)
        made = Scene.of(self.model, exact=exact, samples=SAMPLES, clearance=1e-4 * end)
        count = len(exact.transitions)
        certain = sum(float(t.time) < end * (1 - 1e-9) for t in exact.transitions)
        countable = made.countable if exact.verdict.theorem == "left" else (certain, count)
        return replace(made, countable=countable, **numbers)

    def _own(self, scene: Scene, tool: Tool, arguments: Mapping[str, Any]) -> Cell:
        given: dict[str, Any] = {**arguments, "parameters": scene.parameters, "initial": scene.initial}
        run = self.model.simulate(scheme=tool.scheme or None, method=tool.method or None, **given)
        cell = _cell(scene, scene.result(run), run.stop.reason)
        if cell.word in (CONVERGED, INACCURATE) and not _same_transitions(scene, run):
            cell = cell._replace(word=OTHER, why="other transitions")
        if self.with_rho and cell.word in (CONVERGED, INACCURATE) and len(run.times) <= MOST_ROWS:
            cell = cell._replace(rho=self._rho(scene, run))
        return cell

    def _rho(self, scene: Scene, run: Execution) -> float:
        options: dict[str, Any] = {"model": self.model, "parameters": scene.parameters, "seconds": SECONDS}
        try:
            rho = distance_of_runs(run, scene.exact, **options).interval
        except UsageError:  # the model's space has none
            return nan
        return rho.upper if isfinite(rho.upper) and rho.upper - rho.lower <= LOOSE * rho.upper else nan


def _cell(scene: Scene, result: Result, reason: str) -> Cell:
    """The outcome of a run in a word."""
    found = outcome(scene, result, WITHIN)
    if found.word == "stops":
        word = BLOWN_UP if reason in RAN_AWAY or found.error > LARGE else STUCK
    elif found.word == "right":
        jumps = np.array([float(t.time) for t in scene.exact.transitions])
        near = np.abs(scene.grid[:, None] - jumps).min(axis=1, initial=inf) <= WITHIN.time * scene.grid[-1]
        apart = (np.abs(scene.exact_values - result.values) / spans(scene))[~near]
        return Cell(CONVERGED, nan, float(np.fmax.reduce(apart, axis=None, initial=nan)), found.transitions, found.why)
    elif found.error > LARGE:
        word = BLOWN_UP
    else:
        others = ("transitions",) if found.transitions is not None else ("transitions", "modes")
        word = OTHER if found.other in others else INACCURATE
    return Cell(word, nan, found.error, found.transitions, found.why)


def _same_transitions(scene: Scene, run: Execution) -> bool:
    """Whether the transitions are the reference's, up to those at the end; any are where it has no certain ones."""
    if scene.exact.verdict.theorem == "left":
        return True
    both = zip(run.transitions, scene.exact.transitions, strict=False)
    return all(one.edge == other.edge or one.edge in other.alternatives for one, other in both)


STEPS = 400  # on a logarithmic scale, before the interval of the limit is halved
HALVINGS = 40
ROUNDING = 1e-12  # of |R|, and of an eigenvalue's real part beside its size


def stability_polynomial(method: ButcherTableau) -> list[Fraction]:
    """The coefficients of R, that of 1 first: b A^(k-1) 1 for z^k."""
    n, coefficients = len(method.b), [Fraction(1)]
    stages = [Fraction(1)] * n
    for _ in range(n):
        coefficients.append(sum((Fraction(w) * s for w, s in zip(method.b, stages, strict=True)), Fraction(0)))
        rows = method.a[:n]
        stages = [sum((Fraction(a) * s for a, s in zip(row, stages, strict=False)), Fraction(0)) for row in rows]
    return coefficients


def grows_on_the_axis(coefficients: Sequence[Fraction]) -> bool:
    """Whether |R(iy)| > 1 for all small y: the lowest coefficient of |R(iy)|^2 - 1 is positive."""
    coefficients = [*coefficients, *[Fraction(0)] * len(coefficients)]
    real = [c * (-1) ** (k // 2) if k % 2 == 0 else Fraction(0) for k, c in enumerate(coefficients)]
    imaginary = [c * (-1) ** (k // 2) if k % 2 else Fraction(0) for k, c in enumerate(coefficients)]
    squares = [
        sum((part[k] * part[n - k] for part in (real, imaginary) for k in range(n + 1)), Fraction(0))
        for n in range(1, len(coefficients))
    ]
    return next((c > 0 for c in squares if c), False)


def eigenvalues(model: Model, arguments: Mapping[str, Any]) -> Array | None:
    """Eigenvalues of the flows of all modes; None where one of them is not linear in the states.

    A flow is linear where its derivatives are the same at three random states and times.
    """
    try:
        ready = model.pipeline.prepare({**arguments, "engine": "python"})
    except UsageError:
        return None
    until, random, found = float(ready.settings.until), np.random.default_rng(0), list[Array]()
    for k, mode in enumerate(model.program.modes):
        if not mode.states or mode.final:
            continue
        n, matrices = len(mode.states), list[Array]()
        for t in (0.0, 0.37 * until, 0.81 * until):
            jacobian = ready.kernel.jacobian(k, ready.timeline.at(t).data)
            try:
                matrices.append(np.array(jacobian(t, *random.normal(size=n).tolist()), float).reshape(n, n))
            except (ArithmeticError, ValueError):
                return None
        if any(not np.array_equal(matrices[0], other) for other in matrices[1:]):
            return None
        found.append(np.linalg.eigvals(matrices[0]))
    return np.concatenate(found) if found else None


def largest_step(method: str, values: Array, low: float, high: float) -> float | None:
    """The largest stable step within [low, high].

    None where there is no limit in there, where no step is stable, or where the method is no table.
    """
    table = METHODS.get(method)
    size, growth = np.abs(values), np.real(values)
    decaying = values[(growth <= ROUNDING * size) & (size > 0)]
    if not isinstance(table, ButcherTableau) or not len(decaying):
        return None
    coefficients = stability_polynomial(table)
    swings = np.abs(np.real(decaying)) <= ROUNDING * np.abs(decaying)
    if np.any(swings) and grows_on_the_axis(coefficients):
        return None
    powers = [float(c) for c in reversed(coefficients)]

    def stable(h: float) -> bool:
        return bool(np.all(np.abs(np.polyval(powers, h * decaying)) <= 1 + ROUNDING))

    steps = np.geomspace(low, high, STEPS)
    first = next((i for i, h in enumerate(steps) if not stable(float(h))), None)
    if not first:  # none is unstable, or all are
        return None
    a, b = float(steps[first - 1]), float(steps[first])
    for _ in range(HALVINGS):
        middle = (a * b) ** 0.5
        a, b = (middle, b) if stable(middle) else (a, middle)
    return a
