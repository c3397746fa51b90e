# pyright: basic
"""Parameters and the named subexpressions of `let`: each may use the ones before it."""

from __future__ import annotations

from collections import ChainMap

from hsdsl.elaborate.world import Values, World, in_turn
from hsdsl.expression.scope import Scope, Value, symbol
from hsdsl.schema import ParameterEntry
from hsdsl.source import Scalar
from hsdsl.system import Parameter

_UNDER_LET = "give it under `let`, which may use everything"
_ONLY_PARAMETERS = "a parameter is an expression of earlier parameters"


def define_parameters(world: World) -> tuple[Parameter, ...]:
    """Every parameter; what its name means goes to ``world.values``."""
    refused: Values = {}
    earlier: Values = {}
    scope = Scope(ChainMap(refused, earlier, world.scope((), _ONLY_PARAMETERS, hint=_UNDER_LET).values))  # pyright: ignore[reportArgumentType]
    found: list[Parameter] = []
    for name in in_turn(world.document.parameters, "parameters", refused):
        entry = world.document.parameters[name]
        scalar = entry.value if isinstance(entry, ParameterEntry) else entry
        value = world.reader.number(scalar, scope, finite_now=True)
        world.values[name] = earlier[name] = None if value is None else Value(symbol(name), value.number)
        extra = _extra(world, entry, scope) if isinstance(entry, ParameterEntry) else {}
        if value is not None:
            _check_bounds(world, name, scalar, value, extra)
            exprs = {key: part.expr if isinstance(part, Value) else part for key, part in extra.items()}
            unit = exprs.pop("unit", None) or world.text(world.document.units.get(name))
            found.append(Parameter(name, value.expr, scalar.value, unit, **exprs))
    return tuple(found)


def parameter_scope(world: World, sentence: str, hint: str | None = None) -> Scope:
    """A scope with the parameters alone."""
    return world.scope(("parameters",), sentence, hint=hint)


def _extra(world: World, entry: ParameterEntry, scope: Scope) -> dict:
    bounds = {"minimum": entry.min, "maximum": entry.max}
    read = {k: world.reader.number(s, scope, finite_now=True) for k, s in bounds.items() if s is not None}
    return {**read, "unit": world.text(entry.unit), "about": world.text(entry.about)}


def _check_bounds(world: World, name: str, scalar: Scalar, value: Value, extra: dict) -> None:
    least, most = extra.get("minimum"), extra.get("maximum")
    if least is not None and most is not None and least.number > most.number:
        message = f"the least value of '{name}' is above its largest"
        world.reader.add(scalar.place, "HS309", message, "exchange `min` and `max`")
    elif least is not None and value.number < least.number:
        message = f"'{name}' is {_number(value)}, below its least value {_number(least)}"
        world.reader.add(scalar.place, "HS309", message)
    elif most is not None and value.number > most.number:
        message = f"'{name}' is {_number(value)}, above its largest value {_number(most)}"
        world.reader.add(scalar.place, "HS309", message)


def _number(value: Value) -> str:
    return f"{float(value.number):.6g}"


def define_lets(world: World) -> None:
    """The meaning of every top-level `let`, in ``world.values``: it may use states, and says which it used."""
    base = world.scope(("time", "parameters", "inputs", "states"), "").values
    refused: Values = {}
    earlier: Values = {}
    scope = Scope(ChainMap(refused, earlier, base))  # pyright: ignore[reportArgumentType]
    for name in in_turn(world.document.let, "`let` names", refused):
        world.values[name] = earlier[name] = world.reader.number(world.document.let[name], scope)
