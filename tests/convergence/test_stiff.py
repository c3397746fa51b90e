"""Stiff problems with known ends: accuracy against the tolerance, steps that need not follow what has decayed.

Each file in ``stiff`` is a model with its reference.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from convergence.scene import slope
from engines import assert_engines_agree, needs_compiler
from scipy.integrate import solve_ivp

import hsdsl
from hsdsl.interface.model import Model
from hsdsl.language.elaborate import elaborate

PROBLEMS = {path.stem: path for path in sorted((Path(__file__).parent / "stiff").glob("*.yaml"))}
TOLERANCES = (1e-4, 1e-6, 1e-8)
MOST_STEPS = {  # a tenth above what they are: they grow as tolerance**(-1/4), not with the rates
    "hires": (87, 345, 1515),
    "oregonator": (230, 605, 1840),
    "robertson": (207, 294, 575),
    "van-der-pol": (190, 535, 1720),
    "van-der-pol-smooth": (16, 17, 33),
}
# Errors at the end in tolerances of a state's largest size, a tenth above what they are. Between the spikes of the
# oregonator and of van der Pol's equation the states are small beside their peaks, and their phase is what is lost.
MOST_ERRORS = {
    "hires": (0.75, 0.3, 0.15),
    "oregonator": (49, 6.1, 23),
    "robertson": (0.1, 0.1, 0.1),
    "van-der-pol": (79, 15.5, 0.3),
    "van-der-pol-smooth": (0.1, 0.1, 0.1),
}


@needs_compiler
@pytest.mark.parametrize("scheme", ["relaxed", "located"])
@pytest.mark.parametrize("name", PROBLEMS)
def test_end_against_reference(name: str, scheme: str) -> None:
    """The tolerance bounds each step's error relative to the largest size of a state, and so the error at the end."""
    model = hsdsl.load(PROBLEMS[name])
    (reference,) = model.system.reference
    (known,) = reference.states
    for tolerance, steps, errors in zip(TOLERANCES, MOST_STEPS[name], MOST_ERRORS[name], strict=True):
        run = model.simulate(tolerance=tolerance, scheme=scheme, engine="c")
        for k, (state, value) in enumerate(run.final.state.items()):
            largest = float(np.max(np.abs(run.values[:, k])))
            off = abs(value - float(known.values[state]))
            assert off <= errors * tolerance * largest + float(reference.trust), (tolerance, state)
        assert len(run.times) <= steps, tolerance


@needs_compiler
@pytest.mark.parametrize("name", PROBLEMS)
def test_engines_agree(name: str) -> None:
    assert_engines_agree(hsdsl.load(PROBLEMS[name]), scheme="located", tolerance=1e-4)


@pytest.mark.parametrize("rate", [-1e4, -1e6])
def test_order_of_a_curve_that_a_decay_holds(rate: float) -> None:
    """For x' = rate (x - cos t) - sin t, steps far above 1/rate: the curve has order 4, its ends are better still."""
    made = model(f"{{x: {rate!r}*(x - cos(t)) - sin(t)}}", "x: 1")
    steps, times = [0.2 / 2**k for k in range(5)], np.linspace(0, 2, 1001)
    runs = [made.simulate(step=step, until=2) for step in steps]
    between = [np.max(np.abs(run.sample(times)["x"] - np.cos(times))) for run in runs]
    at_ends = [np.max(np.abs(run.values[:, 0] - np.cos(run.times))) for run in runs]
    assert abs(slope(steps, between) - 4) <= 0.15, between
    for h, end, curve in zip(steps, at_ends, between, strict=True):
        assert end <= 20 / (h * -rate) * curve


def model(flow: str, initial: str) -> Model:
    text = f"hsdsl: 1\nmodes: {{m: {{flow: {flow}}}}}\ninitial: {{mode: m, {initial}}}\n"
    return Model(elaborate("stiff.yaml", text=f"{text}experiment: {{until: 1, method: radau}}\n".encode()))


def brusselator(cells: int) -> tuple[Model, Any, list[float]]:
    """Two substances that react and diffuse along a line (Hairer and Wanner 1996, IV.1), cut into cells."""
    share = 0.02 * (cells + 1) ** 2
    flow: list[str] = []
    for i in range(1, cells + 1):
        for letter, edge, reaction in (("u", 1, "1 + u{0}**2*v{0} - 4*u{0}"), ("v", 3, "3*u{0} - u{0}**2*v{0}")):
            left, right = (f"{letter}{j}" if 1 <= j <= cells else str(edge) for j in (i - 1, i + 1))
            diffusion = f"{share!r}*({left} - 2*{letter}{i} + {right})"
            flow.append(f'{letter}{i}: "{reaction.format(i)} + {diffusion}"')
    start = [v for i in range(1, cells + 1) for v in (1 + np.sin(2 * np.pi * i / (cells + 1)), 3.0)]
    names = [f"{letter}{i}" for i in range(1, cells + 1) for letter in "uv"]

    def field(t: float, x: Any) -> Any:
        u, v = (np.concatenate([[e], x[k::2], [e]]) for k, e in ((0, 1.0), (1, 3.0)))
        cubic = u[1:-1] ** 2 * v[1:-1]
        rows = np.empty_like(x)
        rows[0::2] = 1 + cubic - 4 * u[1:-1] + share * (u[:-2] - 2 * u[1:-1] + u[2:])
        rows[1::2] = 3 * u[1:-1] - cubic + share * (v[:-2] - 2 * v[1:-1] + v[2:])
        return rows

    initial = ", ".join(f"{name}: {float(x)!r}" for name, x in zip(names, start, strict=True))
    return model("{" + ", ".join(flow) + "}", initial), field, start


@needs_compiler
def test_many_states() -> None:
    made, field, start = brusselator(16)
    assert_engines_agree(made, scheme="located", tolerance=1e-3, until=0.05)
    run = made.simulate(tolerance=1e-7, until=2)
    theirs = solve_ivp(field, (0, 2), start, "Radau", rtol=1e-9, atol=1e-9).y[:, -1]
    assert np.max(np.abs(list(run.final.state.values()) - theirs)) <= 1e-6
