"""Systems of states and their derivatives, against the same ones solved whole."""

from __future__ import annotations

import numpy as np
import pytest

import hsdsl
from hsdsl.base.graphs import Variation, variation
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.integrators.radau import Steps, coefficients
from hsdsl.engine.integrators.stepper import Derivatives
from hsdsl.engine.scheme import radau as text
from hsdsl.engine.scheme.linear import Blocks, solve_all, solve_all_complex
from hsdsl.engine.scheme.newton import Radau
from hsdsl.mathematics.lower.mode import ordering

STATES, STEP = 5, 0.3
COLUMNS = ((0, 1, 2, 3, 4), (1, 3, 4), (4,))  # 4 depends on all, 1 and 3 on each other, 0 and 2 on themselves
NEXT = ((0,), (1, 3), (2,), (1, 3), (0, 1, 2, 3, 4))


def whole(random: np.random.Generator) -> np.ndarray:
    """A Jacobian of five states, three columns of their derivatives, and two states that do not flow."""
    block = np.zeros((STATES, STATES))
    for i, row in enumerate(NEXT):
        block[i, list(row)] = random.normal(size=len(row)) * 10.0 ** random.integers(-3, 4, size=len(row))
    n = STATES + sum(map(len, COLUMNS)) + 2
    found = np.zeros((n, n))
    found[:STATES, :STATES] = block
    at = STATES
    for column in COLUMNS:
        rows = range(at, at + len(column))
        found[np.ix_(rows, rows)] = block[np.ix_(column, column)]
        found[np.ix_(rows, range(STATES))] = random.normal(size=(len(column), STATES)) * (random.random(STATES) < 0.5)
        at += len(column)
    return found


def factored_at(jacobian: np.ndarray, of: Variation) -> tuple[Blocks, Radau]:
    """What a step of length STEP solves for, and factors of its matrices."""
    n, places = len(jacobian), np.flatnonzero(jacobian).tolist()
    known = Derivatives(lambda t, *x: jacobian.ravel().tolist(), [1.0] * n, places=places, varied=of)
    made = Steps(known, 1e-6, FLOAT64)
    text.evaluate_jacobian(known, made.blocks, made.text, 0.0, [0.0] * n)
    assert text.factor_all(made.blocks, coefficients(FLOAT64), made.text, STEP, [1.0] * n)
    return made.blocks, made.text


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("is_sparse", [False, True])
def test_blocks_solve_the_whole_system(seed: int, is_sparse: bool) -> None:
    random = np.random.default_rng(seed)
    jacobian = whole(random)
    n, places = len(jacobian), tuple(np.flatnonzero(jacobian).tolist())
    inside = [k // n * STATES + k % n for k in places if k // n < STATES]
    order = tuple(range(STATES)) if is_sparse else ordering(inside, STATES)
    of = variation(places, n, STATES, COLUMNS, order)
    assert (of.elimination is not None) == is_sparse
    known, right, flowing = coefficients(FLOAT64), random.normal(size=(3, n)), n - 2
    right[:, flowing:] = 0
    systems = (known.gamma * np.eye(n) - STEP * jacobian, (known.alpha - 1j * known.beta) * np.eye(n) - STEP * jacobian)
    solved = np.linalg.solve(systems[0], right[0]), np.linalg.solve(systems[1], right[1] + 1j * right[2])
    blocks, steps = factored_at(jacobian, of)
    found, a, b = [0.0] * n, [0.0] * n, [0.0] * n
    solve_all(blocks, steps.factors, right[0].tolist(), found)
    solve_all_complex(blocks, steps.factors, right[1].tolist(), right[2].tolist(), a, b)
    for mine, exact in ((np.array(found), solved[0]), (np.array(a) + 1j * np.array(b), solved[1])):
        assert np.allclose(mine, exact, rtol=1e-9, atol=1e-9 * abs(exact).max())


@pytest.mark.parametrize("soon", [0.0, 1.0, 1e9])
def test_estimate_of_derivatives(soon: float) -> None:
    """Of S' = -2 S + x, where x stays zero: the first defect counts by the share that lasts, the second in full."""
    of, rate, h = variation((0, 2, 3), 2, 1, ((0,),), (0,)), 2.0, 0.1
    slopes = (-rate, 0.0, 1.0, -rate)
    known = Derivatives(lambda t, x, s: slopes, [1.0, 1.0], places=(0, 2, 3), varied=of, soon=soon)
    steps = Steps(known, 1e-6, FLOAT64)
    end, stages = steps.step(lambda t, x, s: (-rate * x, x - rate * s), 0.0, h, (0.0, 1.0), (0.0, -rate))
    assert np.isclose(end[1], np.exp(-rate * h), rtol=1e-6)
    known, z = coefficients(FLOAT64), [stage[1] for stage in stages[:3]]
    inside = -rate * (1 + sum(w * a for w, a in zip(known.value, z, strict=True)))
    first = -rate * h + sum(w * a for w, a in zip(known.estimate, z, strict=True))
    second = inside * h - sum(w * a for w, a in zip(known.slope, z, strict=True))
    counted = max(abs(first) / (1 + rate * soon), abs(second))
    assert np.isclose(abs(stages[3][1]), counted / (known.gamma + rate * h), rtol=1e-12)
    assert stages[3][0] == 0


def test_what_nothing_moves_stays_zero() -> None:
    """Of a column whose right-hand side moves only the last state, though its row has by far the largest numbers."""
    jacobian = whole(np.random.default_rng(3))
    jacobian[4, :5] *= 1e6
    n, places = len(jacobian), tuple(np.flatnonzero(jacobian).tolist())
    varied = variation(places, n, 5, COLUMNS, ())
    (blocks, steps), found = factored_at(jacobian, varied), [0.0] * n
    solve_all(blocks, steps.factors, [1.0 if i == 9 else 0.0 for i in range(n)], found)
    assert found[9] != 0 and not any(found[5:9])


def test_matrices_are_those_of_the_states(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many derivatives there are, a step factors no larger matrices than one of the run."""
    sizes, factored = set[int](), text.factored

    def noted(n, *others):
        sizes.add(n)
        return factored(n, *others)

    monkeypatch.setattr(text, "factored", noted)
    model = hsdsl.load("models/stiff-switch.yaml")
    model.sensitivity("fast,slow,high,initial.y2", until=0.01, tolerance=1e-5, engine="python")
    assert sizes == {2}


def test_derivatives_that_start_as_zero() -> None:
    """The derivative of a state that a parameter does not move is zero to the last bit, and steps do not notice it."""
    model = hsdsl.loads("""
hsdsl: 1
parameters: {k: 3e5, a: 1.5}
modes:
  A:
    flow: {x: 3 - a*x, y: -k*(y - x - z), z: -10*k*(z - x/2)}
    transitions: [{when: y >= 5, to: A, reset: {x: y/2}}]  # not reached; there x would depend on k
initial: {mode: A, x: 0.1, y: 0.1, z: 0.02}
experiment: {until: 0.02, method: radau}
""")
    found = model.sensitivity("k", tolerance=1e-9)
    assert found.final.state["x"]["k"] == 0
    assert len(found.execution.times) < 2 * len(model.simulate(tolerance=1e-9, scheme="located").times)
