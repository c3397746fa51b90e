"""Integrators, most of them tables; METHODS has the names for models and the command line, also those of plug-ins.

A method has the properties `kind`, `implicit`, `is_series`, `adaptive`, `order`, `error_order`, `degree`, `digits`, and
`for_tolerance`.
"""

from __future__ import annotations

from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.base.plugins import Table
from hsdsl.engine.integrators.stepper import RADAU, RadauMethod
from hsdsl.engine.integrators.tableau import ButcherTableau
from hsdsl.engine.integrators.taylor import TaylorMethod

Method = ButcherTableau | TaylorMethod | RadauMethod
_HERE = "hsdsl.engine.integrators."
_FAMILY = ("euler", "midpoint", "heun", "ralston", "rk4", "dopri5")
_EXPLICIT = {name: f"{_HERE}explicit:{name.upper()}" for name in _FAMILY} | {"dop853": f"{_HERE}dop853:DOP853"}


def _fault(name: str, value: Any) -> str | None:
    if not isinstance(value, ButcherTableau):
        return f"'{name}': expected a ButcherTableau, got {type(value).__name__}"
    return None if value.name == name else f"expected the method's own name '{value.name}', got '{name}'"


def _none(_name: str, _value: Any) -> str:
    return "methods are added to METHODS"


# A table checks itself when its module is imported, so that is done at first use.
INTEGRATORS = Table[ButcherTableau]("own methods", _EXPLICIT, _none)
_OTHERS = {"taylor": f"{_HERE}taylor:TAYLOR", "radau": f"{_HERE}stepper:RADAU"}
METHODS = Table[Method]("methods", {**_EXPLICIT, **_OTHERS}, _fault)
FALLBACK = "dopri5"  # what `method: auto` is where nothing is known of a flow but its values


def method_name(method: str | ButcherTableau) -> str:
    """The name of a method; a table given in place of one is registered under its name.

    Raises UsageError: another table has that name.
    """
    if not isinstance(method, ButcherTableau):
        return method
    known = METHODS.get(method.name)
    if known is None:
        METHODS.register(method.name, method)
    elif vars(known) != vars(method):
        raise UsageError(f"another method is called '{method.name}'", "give this table another name")
    return method.name


__all__ = ["FALLBACK", "INTEGRATORS", "METHODS", "RADAU", "ButcherTableau", "Method", "RadauMethod", "TaylorMethod"]
