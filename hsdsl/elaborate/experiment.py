# pyright: basic
"""Where a run starts, and what the file asks of it."""

from __future__ import annotations

from typing import Any

from hsdsl.elaborate.definitions import parameter_scope
from hsdsl.elaborate.edges import known_mode
from hsdsl.elaborate.world import World
from hsdsl.errors import STEP_AND_TOLERANCE
from hsdsl.expression.scope import Scope, Value
from hsdsl.names import closest, did_you_mean, shown
from hsdsl.source import ABSENT, Key, Scalar
from hsdsl.system import Experiment, Initial

_POSITIVE = ("step", "tolerance", "relaxation")


def elaborate_initial(world: World) -> Initial:
    """The initial mode and the values of its states."""
    document = world.document.initial
    hint = "name the value under `parameters`, and write that name for both"
    scope = parameter_scope(world, "an initial value is an expression of parameters", hint)
    given: dict[Key, Scalar] = document.__pydantic_extra__
    values = {str(key): world.reader.number(scalar, scope, finite_now=True) for key, scalar in given.items()}
    mode = known_mode(world, document.mode)
    if mode is not None:
        _check_states(world, mode, given)
    return Initial(mode or "", tuple((name, v.expr) for name, v in values.items() if v is not None))


def _check_states(world: World, mode: str, given: dict[Key, Scalar]) -> None:
    document = world.document.modes[mode]  # pyright: ignore[reportArgumentType]
    if document.flow is None:
        return  # entered with whatever is given, or reported
    lacking = [s for s in world.states[mode] if s not in given]
    for key in given:
        if key not in world.states[mode]:
            message = f"the mode '{mode}' has no state '{shown(key)}'"
            world.reader.add(key.place, "HS308", message, did_you_mean(key, lacking) or _without_flow(mode, key))
            meant = closest(key, lacking)
            lacking = [s for s in lacking if s != meant]
    if lacking:
        noun, verb = ("state", "has") if len(lacking) == 1 else ("states", "have")
        names = ", ".join(f"'{s}'" for s in lacking)
        message = f"the {noun} {names} of the mode '{mode}' {verb} no initial value"
        hint = "add " + ", ".join(f"{s}: ..." for s in lacking)
        world.reader.add(world.document.initial.mode.place, "HS308", message, hint)


def _without_flow(mode: str, key: str) -> str:
    return f"under `flow` of '{mode}' write {shown(key)}: and its derivative, or remove it here"


def elaborate_experiment(world: World) -> Experiment:
    """The settings of the file, as expressions of parameters."""
    document = world.document.experiment
    sentence = "a setting is an expression of parameters"
    scope = parameter_scope(world, sentence)
    if document.step is not None and document.tolerance is not None:
        message = "a run has either a `step` or a `tolerance`, not both"
        last = max((document.step, document.tolerance), key=lambda scalar: scalar.place.start)
        world.reader.add(last.place, STEP_AND_TOLERANCE, message, "keep the one that the method works with")
    end = parameter_scope(world, sentence, "to end with an event, let a transition lead to a mode with final: true")
    until = _setting(world, end, "until", document.until)
    numbers = {key: _setting(world, scope, key, getattr(document, key)) for key in (*_POSITIVE, "max_transitions")}
    return Experiment(
        until=until,
        scheme=world.text(document.scheme),
        method=_placed(document.method),
        samples=_samples(world, scope, document.samples),
        scale=_scale(world, scope, document.scale),
        **numbers,
    )


def _placed(scalar: Scalar | None) -> Key | None:
    """A word that knows its place: whether there is such a method only those above know."""
    return None if scalar is None or scalar.value == ABSENT else Key.at(scalar.value, scalar.place)


def _setting(world: World, scope: Scope, key: str, scalar: Scalar | None) -> Any:
    if scalar is None:
        return None
    value = world.reader.number(scalar, scope, finite_now=True)
    if value is None:
        return None
    wanted = None
    if value.constant:
        wanted = _wanted(key, value)
    if wanted:
        world.reader.add(scalar.place, "HS321", f"`{key}` must be {wanted}, not {shown(scalar.value, 40)}")
    return value.expr


def _wanted(key: str, value: Value) -> str | None:
    """What a constant setting must be, where it is not."""
    whole = value.number == int(value.number)
    if (key in _POSITIVE or key.startswith("scale.")) and not value.number > 0:
        return "positive"
    if key == "until" and value.number < 0:
        return "0 or a later time"
    if key == "max_transitions" and (value.number < 0 or not whole):
        return "a whole number"
    if key == "samples" and (value.number < 2 or not whole):
        return "a list of times, or a whole number of at least 2"
    return None


def _scale(world: World, scope: Scope, given: dict[Key, Scalar]) -> tuple[tuple[str, Any], ...]:
    """The states with a given size, each with the expression of its size."""
    states = world.all_states()
    for key in given:
        if key not in states:
            world.reader.add(key.place, "HS322", f"the model has no state '{shown(key)}'", did_you_mean(key, states))
    sizes = {str(key): _setting(world, scope, f"scale.{key}", scalar) for key, scalar in given.items()}
    return tuple((name, size) for name, size in sizes.items() if size is not None)


def _samples(world: World, scope: Scope, given: Scalar | list[Scalar] | None) -> Any:
    if not isinstance(given, list):
        return _setting(world, scope, "samples", given)
    values = [world.reader.number(scalar, scope, finite_now=True) for scalar in given]
    return tuple(v.expr for v in values if v is not None)
