# pyright: basic
"""References: exact knowledge of runs, checked against the model."""

from __future__ import annotations

from hsdsl.base.names import did_you_mean, shown
from hsdsl.language.elaborate.edges import known_mode
from hsdsl.language.elaborate.symbols import SymbolTable
from hsdsl.language.expression.scope import Scope
from hsdsl.language.schema.documents import (
    ExperimentDocument,
    ReferenceDocument,
    ReferenceStateDocument,
    ReferenceTransitionDocument,
)
from hsdsl.language.source import Key, Scalar, SourceRange
from hsdsl.language.system import KnownState, KnownTransition, Mode, Reference

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
        """One reference."""
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
