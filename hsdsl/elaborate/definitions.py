# pyright: basic
"""Parameters and the named subexpressions of `let`: each may use the ones before it."""

from __future__ import annotations

from hsdsl.elaborate.world import World, later
from hsdsl.expression.scope import Scope, Value, symbol
from hsdsl.schema import ParameterEntry
from hsdsl.source import Scalar
from hsdsl.system import Parameter

_ONLY_PARAMETERS = "a parameter is an expression of earlier parameters"


def define_parameters(world: World) -> tuple[Parameter, ...]:
    """Every parameter; what its name means goes to ``world.values``."""
    names = [str(key) for key in world.document.parameters]
    base = world.scope((), _ONLY_PARAMETERS).values
    found: list[Parameter] = []
    for position, (name, entry) in enumerate(world.document.parameters.items()):
        earlier = {n: world.values.get(n) for n in names[:position]}
        scope = Scope({**base, **later(names, position, "parameters"), **earlier})
        scalar = entry.value if isinstance(entry, ParameterEntry) else entry
        value = world.reader.number(scalar, scope, finite_now=True)
        if value is not None:
            world.values[name] = Value(symbol(name), value.number)
        else:
            world.values[name] = None
        extra = _extra(world, entry, scope) if isinstance(entry, ParameterEntry) else {}
        if value is not None:
            _check_bounds(world, name, scalar, value, extra)
            exprs = {key: part.expr if isinstance(part, Value) else part for key, part in extra.items()}
            unit = exprs.pop("unit", None) or world.text(world.document.units.get(name))
            found.append(Parameter(name, value.expr, scalar.value, unit, **exprs))
    return tuple(found)


def parameter_scope(world: World, sentence: str) -> Scope:
    """A scope with the parameters alone."""
    return world.scope(("parameters",), sentence)


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
    names = [str(key) for key in world.document.let]
    base = world.scope(("time", "parameters", "inputs", "states"), "").values
    for position, (name, scalar) in enumerate(world.document.let.items()):
        earlier = {n: world.values[n] for n in names[:position]}
        scope = Scope({**base, **later(names, position, "`let` names"), **earlier})
        world.values[name] = world.reader.number(scalar, scope)
