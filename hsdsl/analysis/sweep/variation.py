"""What varies in a sweep: the product of grids, each point with one row or with several of random draws.

======================= =====================================================
``c=0.5:0.9:101``       101 values from 0.5 to 0.9, evenly
``c=1e-3:1:50:log``     50 values, evenly in their logarithms
``c=0.1,0.2,0.5``       these values
``c~normal(0.9, 0.02)`` a draw for each row (`hsdsl.analysis.sweep.distributions`)
======================= =====================================================

Rows are numbered with the first name varying slowest, and draws fastest.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hsdsl.analysis.sweep import distributions
from hsdsl.base.errors import UsageError
from hsdsl.base.names import shown
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
            draws = distributions.draw(each.name, self.seed, each.distribution, each.arguments, first, last)
            found[each.name] = draws
        return {name: found[name] for name in self.names}


def read(given: Sequence[str] | Mapping[str, Any], random: int | None, seed: int, number: NumberOf) -> Variation:
    """Read what varies: texts, or values or the text behind the name by name.

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
    return _draw(found[1], found[2], found[3], number)


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


def _draw(name: str, distribution: str, text: str, number: NumberOf) -> Draw:
    given = tuple(number(part.strip(), f"--vary {name}") for part in text.split(",") if part.strip())
    distributions.check(name, distribution, given)
    return Draw(name, distribution, given)


def _checked(grid: Grid) -> Grid:
    if not grid.values or not all(map(math.isfinite, grid.values)):
        raise UsageError(f"--vary {grid.name}: expected finite numbers, got {'none' if not grid.values else 'others'}")
    return grid
