"""Columns of numbers: generated text over arrays of float64, each element to the last bit what one number alone gives.

Sums, products and quotients are NumPy's, which are those of float64; functions are called for each element, since
NumPy's own differ from those of the C library in the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from hsdsl.base.numbers.arithmetic import FLOAT64

Column = Any  # a number that all instances have, or an array with one of each


def varies(*columns: Column) -> bool:
    """Whether one of them is an array."""
    return any(isinstance(column, np.ndarray) for column in columns)


def each(function: Callable[..., Any], *columns: Column) -> Column:
    """A function of numbers, of columns."""
    if not varies(*columns):
        return function(*columns)
    found: Any = np.frompyfunc(function, len(columns), 1)(*columns)
    return found.astype(float)


COLUMNS = replace(
    FLOAT64,
    name="columns",
    functions={name: partial(each, known) if callable(known) else known for name, known in FLOAT64.functions.items()},
)
