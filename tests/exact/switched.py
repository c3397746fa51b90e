"""Scenes whose state never jumps, in closed form, at float times: the error of a run may be read off at any time."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = Any


def oscillator(t: Array) -> dict[str, Array]:
    """X'' = -x from (0, 1), -4 x from x = 1/2 on, -x again from x = 0 on.

    x = sin t up to pi/6; then cos(2 s)/2 + sqrt(3)/4 sin(2 s), until 2 s = pi - atan(2/sqrt(3)), where v = -sqrt(7)/2
    since v^2 + 4 x^2 = 7/4; then -sqrt(7)/2 sin s.
    """
    first = np.pi / 6
    second = first + (np.pi - np.arctan(2 / np.sqrt(3))) / 2
    s, late, root = 2 * (t - first), t - second, np.sqrt(3) / 4
    pieces = [t < first, t < second]
    x = np.select(pieces, [np.sin(t), np.cos(s) / 2 + root * np.sin(s)], -np.sqrt(7) / 2 * np.sin(late))
    v = np.select(pieces, [np.cos(t), -np.sin(s) + 2 * root * np.cos(s)], -np.sqrt(7) / 2 * np.cos(late))
    return {"x": x, "v": v}


def nonlinear(t: Array) -> dict[str, Array]:
    """P' = p (1 - p) from 1/2 up to 2/3, -p^2 down to 1/3, then p (1 - p) again; q' = -2 t q from 1.

    p = 1/(1 + exp(-t)) up to log 2, 1/(3/2 + s) for a time of 3/2, then 1/(1 + 2 exp(-s)); q = exp(-t^2).
    """
    first, second = np.log(2), np.log(2) + 1.5
    pieces = [t < first, t < second]
    with np.errstate(divide="ignore"):
        values = [1 / (1 + np.exp(-t)), 1 / (1.5 + t - first)]
    return {"p": np.select(pieces, values, 1 / (1 + 2 * np.exp(second - t))), "q": np.exp(-(t**2))}
