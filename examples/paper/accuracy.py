"""Fig. 14d and 14e: how wrong the relaxed scheme is, against step and relaxation, beside Paoli and Schatzman's."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields, replace

import numpy as np

from hsdsl.engine.execution import Execution
from hsdsl.interface.model import Model
from hsdsl.interface.model.distances import distance_of_runs as distance
from paper.results import Desk, Finding, say

RATIOS = (2e-2, 2e-3, 2e-4, 2e-5)  # relaxation over step
FULL = tuple(5 * 10 ** (-1 - k / 4) for k in range(13))  # the authors take fifty steps over the same range
FULL_RIVAL = tuple(sorted({*FULL, *(5 * 10 ** (-1 - 3 * k / 49) for k in range(1, 49))}))  # these, and theirs
QUICK = (0.05, 0.005)
QUICK_RATIO = 2e-2


@dataclass(frozen=True)
class Point:
    """A run of the relaxed scheme with the midpoint method, and its errors.

    Attributes
    ----------
    rho_lower, rho_upper : float
        Bounds on the distance in the relaxed space (Def. 22).
    rho_reversed : float
        At most the distance, in the quotient, had the velocity been interpolated backwards inside every step.
    rho_hat : float
        Largest difference of positions at the samples.
    """

    example: int
    ratio: float
    step: float
    relaxation: float
    transitions: int
    rho_lower: float
    rho_upper: float
    rho_reversed: float
    rho_hat: float


@dataclass(frozen=True)
class Rival:
    """A run of the Paoli-Schatzman scheme, and its error."""

    example: int
    step: float
    rho_hat: float


def accuracy(desk: Desk) -> list[Finding]:
    """Run the grid, draw both panels."""
    from paper.drawing.accuracy import draw_rho, draw_rho_hat

    points: list[Point] = []
    rivals: list[Rival] = []
    for example, model in desk.oscillators.items():
        truth = desk.truths[example]
        grid = list(_grid(desk.quick))
        for i, (step, ratio) in enumerate(grid, 1):
            say(f"  example {example}, {i}/{len(grid)}: h = {step:.3g}, eps = {step * ratio:.3g}")
            points.append(measure(example, model, truth, step, ratio))
        rivals += [measure_rival(example, model, truth, step) for step in (QUICK if desk.quick else FULL_RIVAL)]
    desk.table("accuracy", [f.name for f in fields(Point)], [astuple(p) for p in points])
    desk.table("accuracy-paoli-schatzman", [f.name for f in fields(Rival)], [astuple(r) for r in rivals])
    desk.picture("fig14d-rho", lambda: draw_rho(points))
    desk.picture("fig14e-rho-hat", lambda: draw_rho_hat(points, rivals))
    return findings(points, rivals)


def _grid(quick: bool) -> Iterator[tuple[float, float]]:
    for ratio in (QUICK_RATIO,) if quick else RATIOS:
        for step in QUICK if quick else FULL:
            yield step, ratio


def measure(example: int, model: Model, truth: Execution, step: float, ratio: float) -> Point:
    """Run the relaxed scheme once, and compare with the closed form."""
    relaxation = step * ratio
    run = model.simulate(scheme="relaxed", method="midpoint", step=step, relaxation=relaxation)
    rho = distance(run, truth, "relaxed", model=model)
    backwards = distance(velocity_reversed(run), truth, "quotient", model=model)
    hat = rho_hat(run, truth, model)
    transitions = len(run.transitions)
    return Point(example, ratio, step, relaxation, transitions, rho.lower, rho.upper, backwards.upper, hat)


def measure_rival(example: int, model: Model, truth: Execution, step: float) -> Rival:
    """Run the Paoli-Schatzman scheme once, and compare with the closed form."""
    return Rival(example, step, rho_hat(model.simulate(scheme="paoli-schatzman", step=step), truth, model))


def rho_hat(run: Execution, truth: Execution, model: Model) -> float:
    """Return the largest difference of positions at a run's samples."""
    return distance(run, truth, "rho-hat", model=model, coordinates=("x",)).upper


def velocity_reversed(run: Execution) -> Execution:
    """Return a run of straight pieces with the velocity going from its next value back to the present one in each.

    The authors' program evaluates its rho like that; what it plots is about the largest change of velocity in a step.
    """
    v = run.states.index("v")
    inside = np.zeros(len(run.values), dtype=bool)
    for arc in run.arcs:
        inside[arc.first : arc.last] = arc.kind == "flow"
    here = np.flatnonzero(inside)
    values, step = run.values.copy(), np.zeros_like(run.values)
    step[here] = run.values[here + 1] - run.values[here]
    values[here, v] += step[here, v]
    step[here, v] *= -1
    return replace(run, values=values, coefficients=step[:, None, :])


def findings(points: Sequence[Point], rivals: Sequence[Rival]) -> list[Finding]:
    """Say errors at the points that can be compared with other sources, and the slopes over the finer half."""
    found: list[Finding] = []
    for p in points:
        if _listed(p.step, p.ratio):
            at = f"example {p.example}, h = {p.step:.3g}, eps = {p.relaxation:.3g}"
            known = RECORDED.get((p.example, f"{p.step:.3g}", f"{p.relaxation:.3g}"), ("", ""))
            found.append(Finding("Fig. 14d", f"{at}: rho at most", p.rho_upper))
            found.append(Finding("Fig. 14d", f"{at}: rho, velocity reversed", p.rho_reversed, known[0]))
            found.append(Finding("Fig. 14e", f"{at}: rho-hat", p.rho_hat, known[1]))
    for r in rivals:
        if any(math.isclose(r.step, step) for step in (5e-2, 5e-3, 5e-4)):
            at = f"example {r.example}, h = {r.step:.3g}"
            known = RECORDED.get((r.example, f"{r.step:.3g}", ""), ("", ""))
            found.append(Finding("Fig. 14e", f"{at}: rho-hat of Paoli-Schatzman", r.rho_hat, known[1]))
    for example in (1, 2):
        for ratio in RATIOS:
            mine = [p for p in points if (p.example, p.ratio) == (example, ratio) and p.step <= 0.05 * 1.001]
            if len(mine) > 2:
                for name in ("rho_upper", "rho_reversed", "rho_hat"):
                    line = np.polyfit(np.log([p.step for p in mine]), np.log([getattr(p, name) for p in mine]), 1)
                    what = f"example {example}, eps = {ratio:g} h: slope of {WORDS[name]} over h <= 0.05"
                    found.append(Finding("Fig. 14e" if name == "rho_hat" else "Fig. 14d", what, f"{line[0]:.2f}"))
    return found


WORDS = {"rho_upper": "rho", "rho_reversed": "rho with velocity reversed", "rho_hat": "rho-hat"}

# By example, step and relaxation (none: Paoli-Schatzman): rho and rho-hat as the authors' own program recorded them.
RECORDED = {
    (1, "0.0005", "1e-08"): ("0.0347", "8.70e-05"),
    (1, "0.0005", "1e-05"): ("", "0.00203"),
    (2, "0.0005", "1e-08"): ("", "1.92e-07"),
    (2, "0.0005", "1e-05"): ("", "1.28e-05"),
    (1, "0.0005", ""): ("", "0.234"),
    (2, "0.0005", ""): ("", "0.00010025"),
}


def _listed(step: float, ratio: float) -> bool:
    return any(math.isclose(step, s) for s in (5e-2, 5e-3, 5e-4)) and ratio in (RATIOS[0], RATIOS[-1], 2e-4)
