# pyright: basic
"""The initial mode and state, the experiment, and references: exact knowledge of runs, checked against the model."""

from __future__ import annotations

from collections import ChainMap
from typing import Any

from hsdsl.base.errors import STEP_AND_TOLERANCE
from hsdsl.base.graphs import cycle
from hsdsl.base.names import SINCE, closest, did_you_mean, shown
from hsdsl.base.parts import for_all, meant, of_all
from hsdsl.language.elaborate.modes import known_mode
from hsdsl.language.elaborate.symbols import SymbolTable
from hsdsl.language.expression.parse import Name, walk
from hsdsl.language.expression.scope import Scope, Value, state
from hsdsl.language.schema.documents import (
    ExperimentDocument,
    MultiplesDocument,
    RangeDocument,
    ReferenceDocument,
    ReferenceStateDocument,
    ReferenceTransitionDocument,
)
from hsdsl.language.source import ABSENT, Key, Scalar, SourceRange
from hsdsl.language.system import Experiment, Initial, KnownState, KnownTransition, Mode, Reference, started

_OWN = ("step", "tolerance", "relaxation")
_POSITIVE = (*_OWN, "every")


def elaborate_initial(symbols: SymbolTable) -> tuple[Initial, tuple[tuple[str, Any, Any], ...]]:
    """The initial mode and the values of its states, and the states that start in a range, with its ends."""
    document = symbols.document.initial
    given = document.values
    mode = known_mode(symbols, document.mode)
    if mode is not None:
        _check_states(symbols, mode, given)
    ranges = {name: _range(symbols, side) for name, side in document.ranges.items()}
    given = {name: scalar for name, scalar in given.items() if ranges.get(name, ...) is not None}
    texts = {str(key): scalar for key, scalar in given.items()}
    values, own, written = dict[str, Value | None](), dict[str, Value](), list[tuple[str, Any]]()
    outer = symbols.parameter_scope("an initial value is an expression of parameters and of other initial values")
    known, symbolic = (Scope(ChainMap(earlier, outer.values)) for earlier in (values, own))  # pyright: ignore[reportArgumentType]
    for name in _in_order(symbols, given):
        values[name] = symbols.number(texts[name], known, finite_now=True)
        value = None if values[name] is None else symbols.number(texts[name], symbolic)
        written += [(name, value.expr)] if value is not None else []
        own |= {} if values[name] is None else {name: state(name)}
    made = {name for name, _ in written}
    initial = started(mode or "", [name for name in texts if name in made], written)
    return initial, tuple((str(name), *ends) for name, ends in ranges.items() if ends is not None)


def _range(symbols: SymbolTable, given: RangeDocument) -> tuple[Any, Any] | None:
    """The ends of a range; None where they are broken."""
    scope = symbols.parameter_scope("the ends of a range are expressions of parameters")
    ends = symbols.numbers((given.min, given.max), scope, finite_now=True)
    if ends is None:
        return None
    low, high = ends
    if low.number is not None and high.number is not None and low.number > high.number:
        message = f"`min` is {shown(given.min.value, 40)}, larger than `max`, {shown(given.max.value, 40)}"
        symbols.report(given.min.place, "HS321", message, "exchange them")
        return None
    return low.expr, high.expr


def _in_order(symbols: SymbolTable, given: dict[Key, Scalar]) -> list[str]:
    """The states with an initial value, each after those whose value it uses; values in a cycle are left out."""
    trees = {str(key): symbols.tree(scalar) for key, scalar in given.items()}
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
    ordered: dict[str, None] = {}
    while waiting := dict.fromkeys(name for name in uses if name not in ordered):
        ordered |= {name: None for name in waiting if not any(other in waiting for other in uses[name])}
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
    given: Any = document.samples
    every = given.every if isinstance(given, MultiplesDocument) else None
    samples: Any = None if every else given
    if isinstance(given, list):
        times = [symbols.number(scalar, scope, finite_now=True) for scalar in given]
        samples = tuple(time.expr for time in times if time is not None)
    elif samples is not None:
        samples = _setting(symbols, scope, "samples", samples)
    numbers = {key: _setting(symbols, scope, key, getattr(document, key)) for key in (*_OWN, "max_transitions")}
    return Experiment(
        until=until,
        scheme=symbols.text(document.scheme),
        completion=symbols.text(document.completion),
        method=Key.at(method.value, method.place) if method and method.value != ABSENT else None,
        samples=samples,
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


_WORDS = ("initial.mode", "experiment.scheme", "experiment.method")


def elaborate_reference(symbols: SymbolTable, modes: tuple[Mode, ...]) -> tuple[Reference, ...]:
    """The references of the file."""
    checker = _Checker(symbols, modes)
    return tuple(checker.reference(document) for document in symbols.document.reference)


class _Checker:
    """References against one model."""

    def __init__(self, symbols: SymbolTable, modes: tuple[Mode, ...]) -> None:
        self.symbols = symbols
        self.scope: Scope = symbols.parameter_scope("a reference has numbers or expressions of parameters")
        self.edges = list(dict.fromkeys(edge.name for mode in modes for edge in mode.edges))
        self.complete = bool(modes) if symbols.parts else len(modes) == len(symbols.document.modes)
        self.parameters = [name for name, kind in symbols.names.items() if kind == "parameters"]

    def reference(self, document: ReferenceDocument) -> Reference:
        return Reference(
            settings=self.settings(document.settings),
            source=self.symbols.text(document.source),
            trust=None if document.trust is None else self.number(document.trust),
            transitions=tuple(self.transition(event) for event in document.transitions),
            states=tuple(self.state(state) for state in document.states),
        )

    def settings(self, given: dict[Key, Scalar]) -> dict[str, str]:
        """What differs from the file."""
        for key, scalar in given.items():
            group, dot, rest = key.partition(".")
            if key == "initial.mode":
                known_mode(self.symbols, scalar)
            elif key not in _WORDS:
                self.number(scalar)
            if not dot or key in self.parameters:
                self.known(str(key), key.place, "parameter", self.parameters)
            elif group == "initial":
                self.known(rest, key.place, "state", ["mode", *self.symbols.all_states()])
            elif group == "experiment" and rest.startswith("scale."):
                self.known(rest.removeprefix("scale."), key.place, "state", [*self.symbols.all_states()])
            elif group == "experiment":
                self.known(rest, key.place, "setting", list(ExperimentDocument.model_fields))
            else:
                self.known(group, key.place, "group", ["initial", "experiment"])
        return {str(key): scalar.value for key, scalar in given.items()}

    def transition(self, event: Scalar | ReferenceTransitionDocument) -> KnownTransition:
        """A transition, also where its time alone is given."""
        if isinstance(event, Scalar):
            return KnownTransition(self.number(event))
        edge = self.symbols.text(event.edge)
        if event.edge is not None and edge is not None and self.complete:
            self.known(edge, event.edge.place, "transition", self.edges)
        before, after = self.numbers(event.before), self.numbers(event.after)
        return KnownTransition(self.number(event.time), edge, before, after)

    def state(self, state: ReferenceStateDocument) -> KnownState:
        """A state at a time."""
        mode = None if state.mode is None else known_mode(self.symbols, state.mode)
        return KnownState(self.number(state.time), mode, self.numbers(state.__pydantic_extra__))

    def numbers(self, given: dict[Key, Scalar]) -> dict[str, str]:
        """Meanings of states and outputs."""
        columns = [*self.symbols.all_states(), *self.symbols.all_outputs]
        for key in given:
            self.known(key, key.place, "state or output", columns)
        return {str(key): self.number(scalar) for key, scalar in given.items()}

    def number(self, scalar: Scalar) -> str:
        """The text of an expression of parameters."""
        self.symbols.number(scalar, self.scope)
        return scalar.value

    def known(self, name: str, place: SourceRange, kind: str, names: list[str]) -> None:
        """Report a name that nothing has."""
        if name not in names:
            message = f"there is no {kind} '{shown(name)}'"
            self.symbols.report(place, "HS314", message, did_you_mean(name, names))
