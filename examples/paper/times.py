"""Fig. 14f: computation times of the relaxed scheme and of Paoli and Schatzman's, on every engine there is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple, dataclass, fields
from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution
from hsdsl.engine.preparation.pipeline import ENGINES
from hsdsl.interface.model import Model
from paper.accuracy import rho_hat
from paper.results import Desk, Finding, say

RATIOS = (2e-2, 2e-5)
FULL = tuple(5 * 10 ** (-1 - k / 4) for k in range(1, 13))
QUICK = (0.05, 0.005)
QUICK_RATIOS = (2e-2,)
ENOUGH = 0.5  # seconds of measuring, after which a time is taken as it is
REPEATS = 5
ALWAYS = "python"  # the engine that serves everything


@dataclass(frozen=True)
class Timing:
    """A run's time; ``relaxation`` None for the Paoli-Schatzman scheme.

    ``seconds`` is the shortest of up to five simulations, without reading the model and without compiling.
    """

    example: int
    scheme: str
    engine: str
    step: float
    relaxation: float | None
    ratio: float | None
    transitions: int
    seconds: float
    rho_hat: float


def times(desk: Desk) -> list[Finding]:
    """Time the grid on every engine, draw time against step and error against time."""
    from paper.drawing.times import draw

    timings: list[Timing] = []
    for example, model in desk.oscillators.items():
        truth = desk.truths[example]
        for sizes in _grid(desk.quick):
            for engine in ENGINES:
                found = None if engine == "auto" else measure(example, model, truth, engine, sizes)
                if found is not None:
                    timings.append(found)
                    size = "" if found.relaxation is None else f", eps = {found.relaxation:.3g}"
                    at = f"example {example}, {found.scheme}, {engine}: h = {found.step:.3g}{size}"
                    say(f"  {at}: {found.seconds:.3g} s")
    desk.table("times", [f.name for f in fields(Timing)], [astuple(t) for t in timings])
    desk.picture("fig14f-times", lambda: draw(timings))
    return findings(timings)


def _grid(quick: bool) -> Iterator[dict[str, Any]]:
    """Yield steps and relaxations, among them the two that the paper's text compares in example 2."""
    for step in QUICK if quick else FULL:
        yield {"scheme": "paoli-schatzman", "step": step}
        for ratio in QUICK_RATIOS if quick else RATIOS:
            yield {"scheme": "relaxed", "method": "midpoint", "step": step, "relaxation": step * ratio}
    if not quick:
        yield {"scheme": "relaxed", "method": "midpoint", "step": 1e-2, "relaxation": 2e-7}


def measure(example: int, model: Model, truth: Execution, engine: str, sizes: dict[str, Any]) -> Timing | None:
    """Time one run; None where the engine does not serve it, or another one steps in."""
    seconds: list[float] = []
    while True:
        try:
            run = model.simulate(engine=engine, **sizes)
        except UsageError:
            if engine == ALWAYS:
                raise
            return None
        if run.engine != engine:
            return None
        seconds.append(run.seconds["simulate"])
        if sum(seconds) > ENOUGH or len(seconds) == REPEATS:
            break
    relaxation = sizes.get("relaxation")
    ratio = None if relaxation is None else float(f"{relaxation / sizes['step']:.6g}")
    error = rho_hat(run, truth, model)
    transitions = len(run.transitions)
    return Timing(example, run.scheme, run.engine, sizes["step"], relaxation, ratio, transitions, min(seconds), error)


def findings(timings: list[Timing]) -> list[Finding]:
    """Say the times of the two runs that the text compares."""
    found: list[Finding] = []
    for t in timings:
        at = f"example 2, {t.engine}: seconds of"
        if t.example == 2 and t.relaxation == 2e-7 and t.step == 1e-2:
            what = f"{at} relaxed, h = 0.01, eps = 2e-07 (rho-hat {t.rho_hat:.3g})"
            found.append(Finding("Fig. 14f", what, t.seconds, "text: about 0.1; recorded: 1.55"))
        if t.example == 2 and t.relaxation is None and abs(t.step - 5e-4) < 1e-9:
            what = f"{at} Paoli-Schatzman, h = 5e-4 (rho-hat {t.rho_hat:.3g})"
            found.append(Finding("Fig. 14f", what, t.seconds, "text: about 5; recorded: 2.80"))
    return found
