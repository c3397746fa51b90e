# pyright: basic
"""Outputs: what is recorded beside the states. Each mode that has the states of an output has the output."""

from __future__ import annotations

from hsdsl.elaborate.world import World
from hsdsl.expression.scope import Value


def elaborate_outputs(world: World) -> dict[str, Value | None]:
    """What each output is; None where its expression is broken."""
    scope = world.scope(("time", "parameters", "inputs", "states", "let"), "")
    found: dict[str, Value | None] = {}
    for name, scalar in world.document.outputs.items():
        if world.names.get(name) == "states":
            message = f"the output '{name}' has the name of a state"
            world.reader.add(name.place, "HS301", message, "states are recorded anyway")
        found[name] = world.reader.number(scalar, scope)
    return found


def outputs_of(outputs: dict[str, Value | None], states: frozenset[str]) -> tuple:
    """The outputs of a mode with some states; None for one that needs another state."""
    return tuple(v.expr if v is not None and v.uses <= states else None for v in outputs.values())
