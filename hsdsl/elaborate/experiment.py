# pyright: basic
"""The initial mode and state, and the experiment."""

from __future__ import annotations

from typing import Any

from hsdsl.elaborate.edges import known_mode
from hsdsl.elaborate.symbols import SymbolTable
from hsdsl.errors import STEP_AND_TOLERANCE
from hsdsl.expression.scope import Scope, Value
from hsdsl.names import closest, did_you_mean, shown
from hsdsl.source import ABSENT, Key, Scalar
from hsdsl.system import Experiment, Initial

_POSITIVE = ("step", "tolerance", "relaxation")


def elaborate_initial(symbols: SymbolTable) -> Initial:
    """The initial mode and the values of its states."""
    document = symbols.document.initial
    hint = "name the value under `parameters`, and write that name for both"
    scope = symbols.parameter_scope("an initial value is an expression of parameters", hint)
    given: dict[Key, Scalar] = document.__pydantic_extra__
    values = {str(key): symbols.number(scalar, scope, finite_now=True) for key, scalar in given.items()}
    mode = known_mode(symbols, document.mode)
    if mode is not None:
        _check_states(symbols, mode, given)
    return Initial(mode or "", tuple((name, v.expr) for name, v in values.items() if v is not None))


def _check_states(symbols: SymbolTable, mode: str, given: dict[Key, Scalar]) -> None:
    document = symbols.document.modes[mode]  # pyright: ignore[reportArgumentType]
    if document.flow is None:
        return  # entered with the given values, or reported
    lacking = [s for s in symbols.states[mode] if s not in given]
    for key in given:
        if key not in symbols.states[mode]:
            message = f"the mode '{mode}' has no state '{shown(key)}'"
            hint = f"under `flow` of '{mode}' write {shown(key)}: and its derivative, or remove it here"
            symbols.report(key.place, "HS308", message, did_you_mean(key, lacking) or hint)
            meant = closest(key, lacking)
            lacking = [s for s in lacking if s != meant]
    if lacking:
        noun, verb = ("state", "has") if len(lacking) == 1 else ("states", "have")
        names = ", ".join(f"'{s}'" for s in lacking)
        message = f"the {noun} {names} of the mode '{mode}' {verb} no initial value"
        hint = "add " + ", ".join(f"{s}: ..." for s in lacking)
        symbols.report(symbols.document.initial.mode.place, "HS308", message, hint)


def elaborate_experiment(symbols: SymbolTable) -> Experiment:
    """The settings of the file, as expressions of parameters."""
    document = symbols.document.experiment
    sentence = "a setting is an expression of parameters"
    scope = symbols.parameter_scope(sentence)
    if document.step is not None and document.tolerance is not None:
        message = "a run has either a `step` or a `tolerance`, not both"
        last = max((document.step, document.tolerance), key=lambda scalar: scalar.place.start)
        symbols.report(last.place, STEP_AND_TOLERANCE, message, "keep the one that the method works with")
    end = symbols.parameter_scope(sentence, "to end with an event, let a transition lead to a mode with final: true")
    method = document.method  # checked where methods are known, with its place
    until = _setting(symbols, end, "until", document.until)
    numbers = {key: _setting(symbols, scope, key, getattr(document, key)) for key in (*_POSITIVE, "max_transitions")}
    return Experiment(
        until=until,
        scheme=symbols.text(document.scheme),
        completion=symbols.text(document.completion),
        method=Key.at(method.value, method.place) if method and method.value != ABSENT else None,
        samples=_samples(symbols, scope, document.samples),
        scale=_scale(symbols, scope, document.scale),
        **numbers,
    )


def _setting(symbols: SymbolTable, scope: Scope, key: str, scalar: Scalar | None) -> Any:
    if scalar is None:
        return None
    value = symbols.number(scalar, scope, finite_now=True)
    if value is None:
        return None
    range_ = _missed_range(key, value) if value.constant else None
    if range_:
        symbols.report(scalar.place, "HS321", f"`{key}` must be {range_}, not {shown(scalar.value, 40)}")
    return value.expr


def _missed_range(key: str, value: Value) -> str | None:
    """The range of a constant setting that is outside of it."""
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


def _scale(symbols: SymbolTable, scope: Scope, given: dict[Key, Scalar]) -> tuple[tuple[str, Any], ...]:
    """The states with a given size, each with the expression of its size."""
    states = symbols.all_states()
    for key in given:
        if key not in states:
            symbols.report(key.place, "HS322", f"the model has no state '{shown(key)}'", did_you_mean(key, states))
    sizes = {str(key): _setting(symbols, scope, f"scale.{key}", scalar) for key, scalar in given.items()}
    return tuple((name, size) for name, size in sizes.items() if size is not None)


def _samples(symbols: SymbolTable, scope: Scope, given: Scalar | list[Scalar] | None) -> Any:
    if not isinstance(given, list):
        return _setting(symbols, scope, "samples", given)
    values = [symbols.number(scalar, scope, finite_now=True) for scalar in given]
    return tuple(v.expr for v in values if v is not None)
