"""Random numbers of rows: a stream for each varied name, from which row k takes the k-th number.

The stream is Philox's, with a key made of seed and name. So a row has its values whoever computes it, in any order,
and what else is varied does not change them. A uniform number goes through the inverse distribution function.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.names import counted, did_you_mean, shown
from hsdsl.engine.execution import Array

BLOCK = 4  # numbers that Philox makes at a time


@dataclass(frozen=True)
class Distribution:
    """The names of its arguments, what they must fulfil, and its inverse distribution function."""

    arguments: tuple[str, ...]
    needs: str
    fits: Callable[..., bool]
    inverse: Callable[..., Array]


def _rising(low: float, high: float) -> bool:
    return low < high


def _positive(*arguments: float) -> bool:
    return arguments[-1] > 0


def _uniform(u: Array, low: float, high: float) -> Array:
    return low + u * (high - low)


def _loguniform(u: Array, low: float, high: float) -> Array:
    return np.exp(_uniform(u, np.log(low), np.log(high)))


def _normal(u: Array, mean: float, deviation: float) -> Array:
    from scipy.special import ndtri  # pyright: ignore[reportMissingTypeStubs]

    return mean + deviation * ndtri(u)


def _lognormal(u: Array, mean: float, deviation: float) -> Array:
    return np.exp(_normal(u, mean, deviation))


def _exponential(u: Array, mean: float) -> Array:
    return -mean * np.log1p(-u)


def _triangular(u: Array, low: float, mode: float, high: float) -> Array:
    rising = low + np.sqrt(u * (high - low) * (mode - low))
    falling = high - np.sqrt((1 - u) * (high - low) * (high - mode))
    return np.where(u * (high - low) < mode - low, rising, falling)


def _above_zero(low: float, high: float) -> bool:
    return 0 < low < high


def _around(low: float, mode: float, high: float) -> bool:
    return low <= mode <= high and low < high


DISTRIBUTIONS = {
    "uniform": Distribution(("low", "high"), "low < high", _rising, _uniform),
    "loguniform": Distribution(("low", "high"), "0 < low < high", _above_zero, _loguniform),
    "normal": Distribution(("mean", "deviation"), "deviation > 0", _positive, _normal),
    "lognormal": Distribution(("log_mean", "log_deviation"), "log_deviation > 0", _positive, _lognormal),
    "exponential": Distribution(("mean",), "mean > 0", _positive, _exponential),
    "triangular": Distribution(("low", "mode", "high"), "low <= mode <= high and low < high", _around, _triangular),
}


def check(name: str, distribution: str, arguments: Sequence[float]) -> None:
    """Refuse a distribution that there is not, or arguments that do not fit it."""
    known = DISTRIBUTIONS.get(distribution)
    if known is None:
        hint = did_you_mean(distribution, DISTRIBUTIONS)
        raise UsageError(f"--vary {name}: there is no distribution '{shown(distribution)}'", hint)
    form = f"{distribution}({', '.join(known.arguments)})"
    if len(arguments) != len(known.arguments):
        raise UsageError(f"--vary {name}: expected {form}, got {counted(len(arguments), 'number')}")
    if not known.fits(*arguments):
        raise UsageError(f"--vary {name}: {form} needs {known.needs}, got {', '.join(f'{a:g}' for a in arguments)}")


def draw(name: str, seed: int, distribution: str, arguments: Sequence[float], first: int, last: int) -> Array:
    """Draw the numbers of the rows from ``first`` up to ``last``."""
    key = np.random.SeedSequence([seed, *name.encode()]).generate_state(2, np.uint64)
    stream = np.random.Philox(key=key)
    stream.advance(first // BLOCK)
    skip = first % BLOCK
    raw = stream.random_raw(skip + last - first)[skip:]
    uniform = ((raw >> np.uint64(11)) + 0.5) * 2.0**-53  # neither 0 nor 1
    return DISTRIBUTIONS[distribution].inverse(uniform, *arguments)
