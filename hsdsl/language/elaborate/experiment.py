# pyright: basic
"""The initial mode and state, and the experiment."""

from __future__ import annotations

from typing import Any

from hsdsl.base.errors import STEP_AND_TOLERANCE
from hsdsl.base.graphs import cycle
from hsdsl.base.names import SINCE, closest, did_you_mean, shown
from hsdsl.base.parts import for_all, meant, of_all
from hsdsl.language.elaborate.edges import known_mode
from hsdsl.language.elaborate.symbols import SymbolTable
from hsdsl.language.expression.scope import Scope, Value, state
from hsdsl.language.expression.syntax import Name, walk
from hsdsl.language.schema.documents import MultiplesDocument
from hsdsl.language.source import ABSENT, Key, Scalar
from hsdsl.language.system import Experiment, Initial, started

_OWN = ("step", "tolerance", "relaxation")
_POSITIVE = (*_OWN, "every")


def elaborate_initial(symbols: SymbolTable) -> Initial:
    """The initial mode and the values of its states."""
    document = symbols.document.initial
    given: dict[Key, Scalar] = document.__pydantic_extra__
    mode = known_mode(symbols, document.mode)
    if mode is not None:
        _check_states(symbols, mode, given)
    texts = {str(key): scalar for key, scalar in given.items()}
    values, written = dict[str, Value | None](), list[tuple[str, Any]]()
    scope = symbols.parameter_scope("an initial value is an expression of parameters and of other initial values")
    for name in _in_order(symbols, given):
        values[name] = symbols.number(texts[name], Scope({**scope.values, **values}), finite_now=True)
        own = {other: state(other) for other, value in values.items() if value is not None and other != name}
        value = None if values[name] is None else symbols.number(texts[name], Scope({**scope.values, **own}))
        written += [(name, value.expr)] if value is not None else []
    known = {name for name, _ in written}
    return started(mode or "", [name for name in texts if name in known], written)


def _in_order(symbols: SymbolTable, given: dict[Key, Scalar]) -> list[str]:
    """The states with an initial value, each behind those whose value it uses; values in a cycle are left out."""
    trees = {str(key): symbols.resolver.tree(scalar) for key, scalar in given.items()}
    uses = {
        name: [] if tree is None else [n.name for n in walk(tree) if isinstance(n, Name) and n.name in trees]
        for name, tree in trees.items()
    }
    while (found := cycle(uses)) is not None:
        path = " -> ".join((*found, found[0]))
        place = next(scalar.place for key, scalar in given.items() if key == found[0])
        message = f"the initial value of '{found[0]}' is defined by itself: {path}"
        symbols.report(place, "HS302", message, "give one of them by numbers and parameters")
        for name in found:
            del uses[name]
    ordered: list[str] = []
    while waiting := [name for name in uses if name not in ordered]:
        ordered += [name for name in waiting if not {*uses[name]} & {*waiting}]
    return [name for name in ordered if trees[name] is not None]


def _check_states(symbols: SymbolTable, mode: str, given: dict[Key, Scalar]) -> None:
    document = symbols.document.modes[mode]  # pyright: ignore[reportArgumentType]
    if document.flow is None:
        return  # entered with the given values, or reported
    lacking = [s for s in symbols.states[mode] if s not in given]
    for key in given:
        if key not in symbols.states[mode] and not (key == SINCE and symbols.timed):
            message = f"the mode '{mode}' has no state '{shown(key)}'"
            hint = f"under `flow` of '{mode}' write {shown(key)}: and its derivative, or remove it here"
            symbols.report(key.place, "HS308", message, did_you_mean(key, lacking, hint))
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
    given = document.samples
    every = given.every if isinstance(given, MultiplesDocument) else None
    numbers = {key: _setting(symbols, scope, key, getattr(document, key)) for key in (*_OWN, "max_transitions")}
    return Experiment(
        until=until,
        scheme=symbols.text(document.scheme),
        completion=symbols.text(document.completion),
        method=Key.at(method.value, method.place) if method and method.value != ABSENT else None,
        samples=None if every else _samples(symbols, scope, given),
        every=_setting(symbols, scope, "every", every),
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
    known = {*states, *map(of_all, states)}
    for key in given:
        if key not in known:
            symbols.report(key.place, "HS322", f"the model has no state '{shown(key)}'", meant(key, states))
    sizes = {str(key): _setting(symbols, scope, f"scale.{key}", scalar) for key, scalar in given.items()}
    return tuple((name, size) for name, size in for_all(sizes, states).items() if size is not None)


def _samples(symbols: SymbolTable, scope: Scope, given: Any) -> Any:
    if not isinstance(given, list):
        return _setting(symbols, scope, "samples", given)
    values = [symbols.number(scalar, scope, finite_now=True) for scalar in given]
    return tuple(v.expr for v in values if v is not None)
