"""The same loop with numbers of fifty digits: order four gains a factor of 16 a halving, to 1e-20 and below."""

from __future__ import annotations

from itertools import pairwise

import mpmath as mp
import pytest
from convergence.scene import SCENES


def errors(exponents: range) -> list[mp.mpf]:
    """End errors of rk4 on a short run of the switched oscillator, 1/64 before its first switch to 3/64 after."""
    model = SCENES["switched"].model
    s = mp.mpf(3) / 64
    expected = {
        "x": mp.cos(2 * s) / 2 + mp.sqrt(3) / 4 * mp.sin(2 * s),
        "v": mp.sqrt(3) / 2 * mp.cos(2 * s) - mp.sin(2 * s),
    }
    found = []
    for k in exponents:
        run = model.simulate(
            until="1/16",
            method="rk4",
            step=f"2**-{k}",
            relaxation="1e-40",
            precision=50,
            initial={"x": "sin(pi/6 - 1/64)", "v": "cos(pi/6 - 1/64)"},
        )
        assert len(run.transitions) == 1
        found.append(max(abs(run.final.state[name] - value) for name, value in expected.items()))
    return found


@pytest.mark.parametrize(
    "exponents", [range(9, 14), pytest.param(range(14, 19), marks=pytest.mark.slow)], ids=["coarse", "fine"]
)
def test_a_halving_gains_sixteen(exponents: range) -> None:
    with mp.workdps(60):
        found = errors(exponents)
        assert all(abs(one / two - 16) <= 0.1 for one, two in pairwise(found)), found


def test_below_twenty_digits() -> None:
    with mp.workdps(60):
        assert errors(range(16, 17))[0] < 1e-21
