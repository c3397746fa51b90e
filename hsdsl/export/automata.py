"""A system of parts as its file has it: automata, instances and how these are connected, for documents."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from hsdsl.export.source import Source
from hsdsl.language.elaborate import elaborate_files
from hsdsl.language.expression.parse import ExpressionError
from hsdsl.language.expression.plain import names_in
from hsdsl.language.schema.documents import ModelDocument, SystemDocument

Pairs = list[tuple[str, str]]  # names and texts of expressions


class Automaton(NamedTuple):
    """An automaton of the file by its name."""

    name: str
    document: Any

    @property
    def modes(self) -> list[tuple[str, Any]]:
        return [(str(name), mode) for name, mode in self.document.modes.items()]

    @property
    def parameters(self) -> Pairs:
        return [(str(name), _value(entry)) for name, entry in self.document.parameters.items()]

    @property
    def texts(self) -> list[str]:
        """Everything in it that may name another instance."""
        found = [*texts(self.document.let), *texts(self.document.outputs)]
        for _, mode in self.modes:
            found += [*texts(mode.flow or {}), *texts(mode.let), *(scalar.value for scalar in mode.domain)]
            for transition in mode.transitions:
                given = (transition.when, transition.event, transition.condition, transition.on, transition.delay)
                found += [scalar.value for scalar in given if scalar is not None]
                found += [*texts(transition.reset), *map(str, transition.reset)]
        return found


def pairs(table: Any) -> Pairs:
    """A table of expressions as names and texts."""
    return [(str(key), scalar.value) for key, scalar in table.items()]


def texts(table: Any) -> list[str]:
    """The texts of a table of expressions."""
    return [text for _, text in pairs(table)]


def _value(entry: Any) -> str:
    return entry.value if isinstance(entry.value, str) else entry.value.value


class Group(NamedTuple):
    """The instances of one name: ``label`` is that name, with their numbers where there are several."""

    name: str
    given: Any

    @property
    def label(self) -> str:
        """What it is called."""
        return self.name if self.given.count is None else f"{self.name}[1..{self.given.count}]"

    @property
    def settings(self) -> Pairs:
        """Its parameters that differ, and its start."""
        initial = self.given.initial
        extra = pairs(initial.__pydantic_extra__ or {}) if initial else []
        mode = [("mode", initial.mode.value)] if initial and initial.mode is not None else []
        return [*pairs(self.given.parameters), *((f"initial {name}", text) for name, text in [*mode, *extra])]

    @property
    def ends(self) -> Pairs:
        """What is beyond the first and the last of several."""
        return pairs(self.given.at_ends)


class Automata(NamedTuple):
    """The automata and the names of the system of a model, in file order."""

    document: SystemDocument
    automata: list[Automaton]
    groups: list[Group]

    def links(self) -> Iterator[tuple[int, int, str]]:
        """Which group another one depends on, and how: numbers of both, and a text."""
        for k, group in enumerate(self.groups):
            inner = next(a for a in self.automata if a.name == group.given.automaton.value)
            direct = [(name, name) for text in inner.texts for name in _names(text) if "." in name]
            given = [(name, f"{key} = {text}") for key, text in pairs(group.given.inputs) for name in _names(text)]
            for name, label in dict.fromkeys([*given, *direct]):
                for other in self._meant(name):
                    yield other, k, label

    def _meant(self, name: str) -> Sequence[int]:
        base = name.partition("[")[0].partition(".")[0]
        return [k for k, group in enumerate(self.groups) if base in (group.name, group.given.automaton.value)]


def _names(text: str) -> list[str]:
    try:
        return names_in(text)
    except ExpressionError:
        return []


def document_of(source: Source) -> ModelDocument | SystemDocument:
    """The file of a source."""
    files = source.model.pipeline.files
    assert files is not None
    return elaborate_files(files).document


def automata_of(source: Source) -> Automata:
    """The automata of a source whose system has parts."""
    document = document_of(source)
    assert isinstance(document, SystemDocument)
    automata = [Automaton(str(name), kind) for name, kind in document.automata.items()]
    return Automata(document, automata, [Group(str(name), given) for name, given in document.system.items()])
