# pyright: basic
"""Outputs: what is recorded beside the states. A mode has those whose names all mean something in it.

An output of the whole model is read in each mode with that mode's own `let`. One that a mode defines itself goes before
it, and has no value in the other modes.
"""

from __future__ import annotations

from dataclasses import replace

from hsdsl.elaborate.world import World
from hsdsl.expression.scope import Refusal, Scope, Value, state
from hsdsl.schema import Mode as ModeDocument
from hsdsl.source import Key


def elaborate_outputs(world: World) -> dict[str, Value | None]:
    """What each output of the whole model is; None where its expression is broken.

    A `let` name that some mode defines stands for itself, like a state, until the mode is known.
    """
    scope = world.scope(
        ("time", "parameters", "inputs", "states", "let"), "", {name: state(name) for name in world.inner_lets}
    )
    found: dict[str, Value | None] = {}
    for name, scalar in world.document.outputs.items():
        _check_name(world, name)
        found[name] = world.reader.number(scalar, scope)
    for mode in world.document.modes.values():
        for name in mode.outputs:
            _check_name(world, name)
    return found


def _check_name(world: World, name: Key) -> None:
    if world.names.get(name) == "states":
        message = f"the output '{name}' has the name of a state"
        world.reader.add(name.place, "HS301", message, "states are recorded anyway")


def outputs_of(world: World, shared: dict[str, Value | None], document: ModeDocument, scope: Scope) -> tuple:
    """The outputs of a mode, in the order of `World.all_outputs`; None for one that it does not have."""
    found = {name: _here(world, name, value, scope) for name, value in shared.items()}
    found |= {str(name): world.reader.number(scalar, scope) for name, scalar in document.outputs.items()}
    values = (found.get(name) for name in world.all_outputs)
    return tuple(None if value is None else value.expr for value in values)


def _here(world: World, name: str, value: Value | None, scope: Scope) -> Value | None:
    """An output of the whole model in one mode."""
    if value is None:
        return None
    inner = value.uses & world.inner_lets
    if any(isinstance(scope.values[name], Refusal) for name in inner):
        return None
    if inner:
        value = world.reader.number(world.document.outputs[name], replace(scope, states=None))  # pyright: ignore[reportArgumentType]
    return value if value is not None and value.uses <= (scope.states or frozenset()) else None
