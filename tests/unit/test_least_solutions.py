"""Points near which motion along guards is looked for: smallest solutions of linear equations, and their ranks."""

from __future__ import annotations

import numpy as np
import pytest

from hsdsl.completion.nearby import _least

SHAPES = [(1, 1), (1, 4), (3, 3), (3, 7), (7, 3), (6, 6)]


@pytest.mark.parametrize("rows, columns", SHAPES)
@pytest.mark.parametrize("rank", [0, 1, 2, 3])
def test_the_step_is_that_of_the_pseudo_inverse(rows: int, columns: int, rank: int) -> None:
    draw = np.random.default_rng([rows, columns, rank])
    rank = min(rank, rows, columns)
    matrix = draw.normal(size=(rows, rank)) @ draw.normal(size=(rank, columns)) * 10.0 ** draw.integers(-200, 100)
    values = matrix @ draw.normal(size=columns)
    step, found = _least(matrix.tolist(), values.tolist())
    assert found == np.linalg.matrix_rank(matrix) == rank
    np.testing.assert_allclose(step, np.linalg.pinv(matrix) @ values, rtol=1e-8, atol=1e-8)


def test_of_contradictory_equations_the_larger_ones_hold() -> None:
    assert _least([[1.0, 0.0], [2.0, 0.0], [0.0, 1e-12]], [1.0, 6.0, 1.0]) == ([3.0, 0.0], 1)
