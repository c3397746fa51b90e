# pyright: reportUnknownLambdaType=false, reportUnknownArgumentType=false
"""What varies in a sweep: the product of grids, each point with one row or with several of random draws.

======================= =====================================================
``c=0.5:0.9:101``       101 values from 0.5 to 0.9, evenly
``c=1e-3:1:50:log``     50 values, evenly in their logarithms
``c=0.1,0.2,0.5``       these values
``c~normal(0.9, 0.02)`` a draw for each row
======================= =====================================================

Rows are numbered with the first name varying slowest, and draws fastest. Each drawn name has a stream of Philox, with a
key made of seed and name, from which row k takes the k-th number. So a row has its values whoever computes it, in any
order, and what else is varied does not change them. A uniform number goes through the inverse distribution function.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.names import counted, did_you_mean, shown
from hsdsl.engine.execution import Array

EXAMPLE = "for example --vary c=0.5:0.9:101, --vary c=0.1,0.2 or --vary 'c~normal(0.9, 0.02)'"
MOST_VALUES = 10_000_000  # of one grid; each is in the manifest
NumberOf = Callable[[Any, str], float]
_DRAW = re.compile(r"\s*([^=~]+?)\s*~\s*(\w+)\s*\((.*)\)\s*")
_GIVEN = re.compile(r"\s*([^=~]+?)\s*=\s*(.*?)\s*")


@dataclass(frozen=True)
class Grid:
    """Values of a name; ``logarithmic`` where they are even in their logarithms."""

    name: str
    values: tuple[float, ...]
    logarithmic: bool = False


@dataclass(frozen=True)
class Draw:
    """A distribution of a name, and its arguments."""

    name: str
    distribution: str
    arguments: tuple[float, ...]


@dataclass(frozen=True)
class Variation:
    """Grids, and draws: ``random`` rows at each point of the grids, 1 where nothing is drawn."""

    grids: tuple[Grid, ...]
    draws: tuple[Draw, ...]
    random: int
    seed: int

    @property
    def names(self) -> tuple[str, ...]:
        """What varies."""
        return tuple(each.name for each in (*self.grids, *self.draws))

    @property
    def rows(self) -> int:
        """How many runs there are."""
        return math.prod(len(grid.values) for grid in self.grids) * self.random

    def values(self, first: int, last: int) -> dict[str, Array]:
        """The values of the rows from ``first`` up to ``last``."""
        place, found = np.arange(first, last) // self.random, dict[str, Array]()
        for grid in reversed(self.grids):
            found[grid.name] = np.array(grid.values)[place % len(grid.values)]
            place //= len(grid.values)
        for each in self.draws:
            draws = draw(each.name, self.seed, each.distribution, each.arguments, first, last)
            found[each.name] = draws
        return {name: found[name] for name in self.names}


def read(given: Sequence[str] | Mapping[str, Any], random: int | None, seed: int, number: NumberOf) -> Variation:
    """Read what varies: texts, or values or the text after the name by name.

    ``number`` makes a number of a number or an expression.

    Raises UsageError: a text of another form, a name twice, or draws without their number.
    """
    if isinstance(given, str):
        given = [given]
    of_mapping = isinstance(given, Mapping)
    items = [_of(*item, number) for item in given.items()] if of_mapping else [_read(text, number) for text in given]
    names = [item.name for item in items]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise UsageError(f"--vary: {twice} varies twice")
    grids = tuple(item for item in items if isinstance(item, Grid))
    draws = tuple(item for item in items if isinstance(item, Draw))
    if draws and random is None:
        raise UsageError(f"{draws[0].name} is drawn, and the number of draws is missing", "give --random N")
    if random is not None and (random < 1 or not draws):
        what = f"expected at least 1, got {random}" if random < 1 else "nothing is drawn"
        raise UsageError(f"--random: {what}", EXAMPLE)
    if seed and not draws:
        raise UsageError("--seed: nothing is drawn", EXAMPLE)
    if seed < 0:
        raise UsageError(f"--seed: expected a number from 0 on, got {seed}")
    if not items:
        raise UsageError("a sweep needs something that varies", EXAMPLE)
    return Variation(grids, draws, random or 1, seed)


def _read(text: str, number: NumberOf) -> Grid | Draw:
    found = _DRAW.fullmatch(text) or _GIVEN.fullmatch(text)
    if found is None:
        raise UsageError(f"--vary: expected NAME=VALUES or NAME~DISTRIBUTION(...), got '{shown(text)}'", EXAMPLE)
    if len(found.groups()) == 2:
        return _grid(found[1], found[2], number)
    name, distribution, listed = found.groups()
    given = tuple(number(part.strip(), f"--vary {name}") for part in listed.split(",") if part.strip())
    check(name, distribution, given)
    return Draw(name, distribution, given)


def _of(name: str, value: Any, number: NumberOf) -> Grid | Draw:
    """Read a value of a mapping: an array, or the text that follows the name, with ``~`` before a distribution."""
    if isinstance(value, str):
        return _read(f"{name}{value}" if value.lstrip().startswith("~") else f"{name}={value}", number)
    values = np.atleast_1d(np.asarray(value, dtype=float))
    if values.ndim != 1:
        raise UsageError(f"--vary {name}: expected a sequence of numbers, got an array of shape {values.shape}")
    return _checked(Grid(name, tuple(values.tolist())))


def _grid(name: str, text: str, number: NumberOf) -> Grid:
    where = f"--vary {name}"
    if text.startswith(("[", "(", "{")) and text[1:-1].count(","):
        raise UsageError(
            f"{where}: expected values with commas alone, got '{shown(text)}'", f"--vary {name}={text[1:-1]}"
        )
    if ":" not in text:
        return _checked(Grid(name, tuple(number(part.strip(), where) for part in text.split(","))))
    parts = [part.strip() for part in text.split(":")]
    logarithmic = parts[3:] == ["log"]
    if len(parts) - logarithmic != 3 or not parts[2].isdecimal() or not 1 <= int(parts[2]) <= MOST_VALUES:
        raise UsageError(f"{where}: expected FROM:TO:COUNT or FROM:TO:COUNT:log, got '{shown(text)}'", EXAMPLE)
    low, high, count = number(parts[0], where), number(parts[1], where), int(parts[2])
    if logarithmic and not (low > 0 and high > 0):
        raise UsageError(f"{where}: expected positive ends for :log, got '{shown(text)}'")
    spaced = np.geomspace if logarithmic else np.linspace
    return _checked(Grid(name, tuple(spaced(low, high, count).tolist()), logarithmic))


def _checked(grid: Grid) -> Grid:
    if not grid.values or not all(map(math.isfinite, grid.values)):
        raise UsageError(f"--vary {grid.name}: expected finite numbers, got {'none' if not grid.values else 'others'}")
    return grid


BLOCK = 4  # numbers that Philox makes at a time


def _normal(u: Array, mean: float, deviation: float) -> Array:
    from scipy.special import ndtri  # pyright: ignore[reportMissingTypeStubs]

    return mean + deviation * ndtri(u)


def _triangular(u: Array, low: float, mode: float, high: float) -> Array:
    rising = low + np.sqrt(u * (high - low) * (mode - low))
    falling = high - np.sqrt((1 - u) * (high - low) * (high - mode))
    return np.where(u * (high - low) < mode - low, rising, falling)


def _loguniform(u: Array, low: float, high: float) -> Array:
    return np.exp(np.log(low) + u * (np.log(high) - np.log(low)))


# The names of arguments, what they must fulfil, and the inverse distribution function.
DISTRIBUTIONS: dict[str, tuple[tuple[str, ...], str, Callable[..., bool], Callable[..., Any]]] = {
    "uniform": (("low", "high"), "low < high", operator.lt, lambda u, low, high: low + u * (high - low)),
    "loguniform": (("low", "high"), "0 < low < high", lambda low, high: 0 < low < high, _loguniform),
    "normal": (("mean", "deviation"), "deviation > 0", lambda _, width: width > 0, _normal),
    "lognormal": (
        ("log_mean", "log_deviation"),
        "log_deviation > 0",
        lambda _, width: width > 0,
        lambda *given: np.exp(_normal(*given)),
    ),
    "exponential": (("mean",), "mean > 0", lambda mean: mean > 0, lambda u, mean: -mean * np.log1p(-u)),
    "triangular": (
        ("low", "mode", "high"),
        "low <= mode <= high and low < high",
        lambda low, mode, high: low <= mode <= high > low,
        _triangular,
    ),
}


def check(name: str, distribution: str, arguments: Sequence[float]) -> None:
    """Refuse a distribution that there is not, or arguments that do not fit it."""
    known = DISTRIBUTIONS.get(distribution)
    if known is None:
        hint = did_you_mean(distribution, DISTRIBUTIONS)
        raise UsageError(f"--vary {name}: there is no distribution '{shown(distribution)}'", hint)
    names, needs, fits, _ = known
    form = f"{distribution}({', '.join(names)})"
    if len(arguments) != len(names):
        raise UsageError(f"--vary {name}: expected {form}, got {counted(len(arguments), 'number')}")
    if not fits(*arguments):
        raise UsageError(f"--vary {name}: {form} needs {needs}, got {', '.join(f'{a:g}' for a in arguments)}")


def draw(name: str, seed: int, distribution: str, arguments: Sequence[float], first: int, last: int) -> Array:
    """Draw the numbers of the rows from ``first`` up to ``last``."""
    key = np.random.SeedSequence([seed, *name.encode()]).generate_state(2, np.uint64)
    stream = np.random.Philox(key=key)
    stream.advance(first // BLOCK)
    skip = first % BLOCK
    raw = stream.random_raw(skip + last - first)[skip:]
    uniform = ((raw >> np.uint64(11)) + 0.5) * 2.0**-53  # neither 0 nor 1
    return DISTRIBUTIONS[distribution][3](uniform, *arguments)
