# pyright: basic
"""What is known exactly: checked against the model, and kept as plain data with numbers as text."""

from __future__ import annotations

from typing import Any

from hsdsl.elaborate.edges import known_mode
from hsdsl.elaborate.symbols import SymbolTable
from hsdsl.expression.scope import Scope
from hsdsl.names import did_you_mean, shown
from hsdsl.schema import ExperimentDocument, ReferenceDocument
from hsdsl.source import ABSENT, Key, Scalar, SourceRange
from hsdsl.system import Mode

_WORDS = ("initial.mode", "experiment.scheme", "experiment.method")


def elaborate_reference(symbols: SymbolTable, modes: tuple[Mode, ...]) -> tuple[dict[str, Any], ...]:
    """The references, with the keys of the file.

    Each is ``{"set": {..}, "source": .., "trust": .., "transitions": [..], "states": [..]}`` with what the file gives;
    a transition is always ``{"time": .., "edge": .., "before": {..}, "after": {..}}``. Numbers are the texts of
    expressions of parameters.
    """
    checker = _Checker(symbols, modes)
    return tuple(checker.reference(document) for document in symbols.document.reference)


class _Checker:
    """References against one model."""

    def __init__(self, symbols: SymbolTable, modes: tuple[Mode, ...]) -> None:
        self.symbols = symbols
        self.scope: Scope = symbols.parameter_scope("a reference has numbers or expressions of parameters")
        self.columns = [*symbols.all_states(), *symbols.all_outputs]
        self.edges = list(dict.fromkeys(edge.name for mode in modes for edge in mode.edges))
        self.complete = len(modes) == len(symbols.document.modes)

    def reference(self, document: ReferenceDocument) -> dict[str, Any]:
        """One reference."""
        made: dict[str, Any] = {"set": self.settings(document.settings)}
        if self.symbols.text(document.source) is not None:
            made["source"] = self.symbols.text(document.source)
        if document.trust is not None:
            made["trust"] = self.number(document.trust)
        made["transitions"] = [self.transition(event) for event in document.transitions]
        made["states"] = [self.state(state) for state in document.states]
        return {key: value for key, value in made.items() if value not in ({}, [])}

    def settings(self, given: dict[Key, Scalar]) -> dict[str, str]:
        """What differs from the file."""
        for key, scalar in given.items():
            group, dot, rest = key.partition(".")
            if key == "initial.mode":
                known_mode(self.symbols, scalar)
            elif key not in _WORDS:
                self.number(scalar)
            if not dot:
                self.known(group, key.place, "parameter", [n for n in self.symbols.document.parameters])
            elif group == "initial":
                self.known(rest, key.place, "state", ["mode", *self.symbols.all_states()])
            elif group == "experiment" and rest.startswith("scale."):
                self.known(rest.removeprefix("scale."), key.place, "state", [*self.symbols.all_states()])
            elif group == "experiment":
                self.known(rest, key.place, "setting", list(ExperimentDocument.model_fields))
            else:
                self.known(group, key.place, "group", ["initial", "experiment"])
        return {str(key): scalar.value for key, scalar in given.items()}

    def transition(self, event: Any) -> dict[str, Any]:
        """A transition, also where its time alone is given."""
        if isinstance(event, Scalar):
            return {"time": self.number(event)}
        made: dict[str, Any] = {"time": self.number(event.time)}
        if event.edge is not None and event.edge.value != ABSENT:
            if self.complete:
                self.known(event.edge.value, event.edge.place, "transition", self.edges)
            made["edge"] = event.edge.value
        for side in ("before", "after"):
            if getattr(event, side):
                made[side] = self.columns_of(getattr(event, side))
        return made

    def state(self, state: Any) -> dict[str, Any]:
        """A state at a time."""
        made: dict[str, Any] = {"time": self.number(state.time)}
        if state.mode is not None:
            known_mode(self.symbols, state.mode)
            made["mode"] = state.mode.value
        return {**made, **self.columns_of(state.__pydantic_extra__)}

    def columns_of(self, given: dict[Key, Scalar]) -> dict[str, str]:
        """Values of states and outputs."""
        for key in given:
            self.known(key, key.place, "state or output", self.columns)
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
