"""Tables that other packages extend: methods, lint rules, export targets, peers and metrics.

A table has the package's own entries, those given in Python by `register`, and those of installed packages, which name
them as entry points of the table's group (``hsdsl.methods``, ...). An entry is a value, or the place of one as a text
``module:name``, imported when it is needed. Installed packages are searched once, and only where a name is none of our
own or all names are asked for: a run by a built-in method does not search.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_arguments, did_you_mean

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")
TABLES = {
    "methods": "hsdsl.engine.integrators:METHODS",
    "rules": "hsdsl.analysis.lint.rules:RULES",
    "targets": "hsdsl.export:TARGETS",
    "peers": "hsdsl.interface.chart.peers:PEERS",
    "metrics": "hsdsl.analysis.metrics.table:CURVE_METRICS",
}


def located(place: str) -> Any:
    """The value at a place ``module:name``."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


class Table(Mapping[str, T], Generic[T]):
    """Entries by name; ``own`` are those of this package, and ``check`` refuses what cannot be an entry.

    ``check(name, value)`` returns the fault of a foreign entry as the end of a sentence, or None.
    """

    def __init__(self, group: str, own: Mapping[str, T | str], check: Callable[[str, Any], str | None]) -> None:
        self.group, self.own, self._check = group, own, check
        self._given: dict[str, T] = {}

    @cached_property
    def _installed(self) -> dict[str, EntryPoint]:
        from importlib.metadata import entry_points

        return {point.name: point for point in entry_points(group=f"hsdsl.{self.group}") if point.name not in self.own}

    def __getitem__(self, name: str) -> T:
        if name in self.own:
            found = self.own[name]
            return located(found) if isinstance(found, str) else cast("T", found)
        if name in self._given:
            return self._given[name]
        point = self._installed[name]
        owner = f"the plug-in {point.value} of the package {point.dist.name if point.dist else '?'}"
        try:
            value = point.load()
        except Exception as error:  # another package may raise any
            raise UsageError(f"{owner} does not load: {type(error).__name__}: {error}") from error
        if fault := self._check(name, value):
            raise UsageError(f"{owner}: {fault}")
        return self._given.setdefault(name, value)

    def __contains__(self, name: object) -> bool:
        return name in self.own or name in self._given or name in self._installed

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys((*self.own, *self._given, *self._installed)))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def register(self, name: str, value: T) -> None:
        """Add an entry, or replace one that was added before.

        Raises UsageError: the name is one of our own, or the value cannot be an entry.
        """
        if name in self.own:
            raise UsageError(f"hsdsl.{self.group}: the name '{name}' is taken by hsdsl itself", "choose another name")
        if fault := self._check(name, value):
            raise UsageError(f"hsdsl.{self.group}: {fault}")
        self._given[name] = value


@checks_arguments
def register(table: str, name: str, value: object) -> None:
    """Add a method, a lint rule, an export target, a peer or a metric, for this process.

    A package adds them for every process by entry points of the groups ``hsdsl.methods``, ``hsdsl.rules``,
    ``hsdsl.targets``, ``hsdsl.peers`` and ``hsdsl.metrics``.

    Parameters
    ----------
    table : {"methods", "rules", "targets", "peers", "metrics"}
        What is added.
    name : str
        The name for options and arguments; for a rule, its code.
    value : object
        A `ButcherTableau`; a `Rule`; a function ``files(source)``; a function ``prepare(scene)``; a function of two
        executions.

    Raises UsageError: there is no such table, the name is taken by hsdsl, or the value is of another kind.
    """
    if table not in TABLES:
        raise UsageError(f"there is no table '{table}'", did_you_mean(table, TABLES))
    cast("Table[Any]", located(TABLES[table])).register(name, value)


def function_expected(what: str) -> Callable[[str, Any], str | None]:
    """The check of a table of functions."""
    return lambda name, value: None if callable(value) else f"'{name}': expected {what}, got {type(value).__name__}"
