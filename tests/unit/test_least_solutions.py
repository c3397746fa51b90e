"""Points near which motion along guards is looked for: smallest solutions of linear equations, and their ranks."""

from __future__ import annotations

import numpy as np
import pytest

from hsdsl.mathematics.completion.nearby import NUMBERS, _least

SHAPES = [(1, 1), (1, 4), (3, 3), (3, 7), (7, 3), (6, 6)]


def least(rows, values):
    """The solution and the rank of equations whose coefficients are as exact as their digits."""
    numbers = [[NUMBERS.zero + entry for entry in row] for row in rows]
    step, count = _least(
        [[(entry, abs(entry)) for entry in row] for row in numbers], [NUMBERS.zero + v for v in values]
    )
    return [float(x) for x in step], count


@pytest.mark.parametrize("rows, columns", SHAPES)
@pytest.mark.parametrize("rank", [0, 1, 2, 3])
def test_the_step_is_that_of_the_pseudo_inverse(rows: int, columns: int, rank: int) -> None:
    draw = np.random.default_rng([rows, columns, rank])
    rank = min(rank, rows, columns)
    left, right = (draw.integers(-99, 99, size=shape) for shape in ((rows, rank), (rank, columns)))
    scale, values = 2.0 ** draw.integers(-600, 300), left @ right @ draw.normal(size=columns)
    step, found = least((left @ right * scale).tolist(), (values * scale).tolist())
    assert found == np.linalg.matrix_rank(left @ right) == rank
    np.testing.assert_allclose(step, np.linalg.pinv(left @ right) @ values, rtol=1e-8, atol=1e-8)


def test_the_unit_of_an_equation_does_not_matter() -> None:
    assert least([[1.0, 0.0], [0.0, 1e-300], [1.0, 1e-30]], [3.0, 1e-300, 4.0]) == ([3.0, 1.0], 2)


def test_of_equations_that_say_the_same_one_holds() -> None:
    assert least([[1.0, 0.0], [2.0, 0.0], [0.0, 1e-12]], [3.0, 6.0, 1.0]) == ([3.0, 1e12], 2)
