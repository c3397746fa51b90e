"""Integrators, most of them tables; METHODS has the names for models and the command line.

A method has the properties `kind`, `implicit`, `is_series`, `adaptive`, `order`, `error_order`, `degree`, `digits`, and
`for_tolerance`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import TypeVar

from hsdsl.engine.integrators.stepper import RADAU, RadauMethod
from hsdsl.engine.integrators.tableau import ButcherTableau
from hsdsl.engine.integrators.taylor import TaylorMethod

Method = ButcherTableau | TaylorMethod | RadauMethod
M = TypeVar("M", bound=Method)
MODULES: dict[str, str] = dict.fromkeys(("euler", "midpoint", "heun", "ralston", "rk4"), "classical")


class _Named(Mapping[str, M]):
    """Methods by name. A table checks itself when its module is imported, so that is done at first use."""

    def __init__(self, *names: str) -> None:
        self._names = names

    def __getitem__(self, name: str) -> M:
        if name not in self._names:
            raise KeyError(name)
        return getattr(import_module(f"hsdsl.engine.integrators.{MODULES.get(name, name)}"), name.upper())

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


INTEGRATORS = _Named[ButcherTableau]("euler", "midpoint", "heun", "ralston", "rk4", "dopri5", "dop853")
METHODS = _Named[Method](*INTEGRATORS, "taylor", "radau")
AUTO = "dopri5"  # what `method: auto` is where nothing is known of a flow but its values

__all__ = ["AUTO", "INTEGRATORS", "METHODS", "RADAU", "ButcherTableau", "Method", "RadauMethod", "TaylorMethod"]
