"""Whether two pieces of recorded data are the same, not-a-number being the same as itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, cast

import numpy as np


def same(a: Any, b: Any) -> bool:
    """Compare numbers, texts, arrays, dataclasses and containers of them by value.

    Arrays must agree in shape and in kind of number (float64 or object), containers in kind and order; fields
    marked ``compare=False`` are left out.
    """
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return _same_arrays(a, b)
    if is_dataclass(a) or is_dataclass(b):
        return type(a) is type(b) and all(
            same(getattr(a, field.name), getattr(b, field.name)) for field in fields(a) if field.compare
        )
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        left, right = cast(Mapping[Any, Any], a), cast(Mapping[Any, Any], b)
        return list(left) == list(right) and all(same(left[key], right[key]) for key in left)
    if isinstance(a, (tuple, list)) and isinstance(b, (tuple, list)):
        left, right = cast("tuple[Any, ...]", a), cast("tuple[Any, ...]", b)
        return (
            isinstance(a, list) == isinstance(b, list)
            and len(left) == len(right)
            and all(same(x, y) for x, y in zip(left, right, strict=True))
        )
    return bool(a == b) or _both_nan(a, b)


def _both_nan(a: Any, b: Any) -> bool:
    return bool(a != a) and bool(b != b)  # the one value that differs from itself


def _same_arrays(a: Any, b: Any) -> bool:
    if not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray)):
        return False
    left, right = cast("np.ndarray[Any, Any]", a), cast("np.ndarray[Any, Any]", b)
    if left.shape != right.shape or (left.dtype == object) != (right.dtype == object):
        return False
    with np.errstate(invalid="ignore"):
        equal = np.asarray(left == right, dtype=bool)
        nan = np.asarray(left != left, dtype=bool) & np.asarray(right != right, dtype=bool)
    return bool(np.all(equal | nan))
