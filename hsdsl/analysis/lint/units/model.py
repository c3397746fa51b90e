"""The units of a model: those its file gives, and what is found in each of its expressions."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from hsdsl.analysis.lint.source_expressions import TIME, SourceExpression
from hsdsl.analysis.lint.units.unit import Unit, UnknownUnit, read
from hsdsl.analysis.lint.units.walk import Any_, Measure, Misfit, Walk
from hsdsl.base.names import SINCE
from hsdsl.language.schema.documents import AutomatonDocument, ModelDocument, ParameterEntry
from hsdsl.language.source import Scalar

_INDEX = re.compile(r"\[[^\]]*\]")
_VALUES = ("parameter", "input", "reset", "output", "initial", "scale", "reference", "experiment", "delay")


@dataclass(frozen=True)
class Checked:
    """An expression, its unit, the one that it should have, if that is known, and what does not fit in it."""

    written: SourceExpression
    measure: Measure
    expected: Unit | None
    misfits: tuple[Misfit, ...]


@dataclass(frozen=True)
class Misread:
    """A text that is no unit, with the names in it that nobody knows, and how it is written here, if that is known."""

    scalar: Scalar
    names: tuple[str, ...]
    better: str | None


class Units:
    """The units of one model, or of one of its automata, from what gives units and its expressions.

    ``of_parts`` has the units of names of instances, which others use.
    """

    def __init__(
        self,
        document: ModelDocument,
        expressions: tuple[SourceExpression, ...],
        automaton: AutomatonDocument | None = None,
        of_parts: Mapping[str, str] | None = None,
    ) -> None:
        self._expressions = expressions
        self._of_parts = {_INDEX.sub("", name): unit for name, unit in (of_parts or {}).items() if "." in name}
        self._functions = {str(e.name): e for e in expressions if e.role == "function"}
        self._lets: dict[str, dict[str | None, Measure]] = {}  # by name, and by the mode that has it
        self._texts = _texts(document)
        if automaton is not None:
            states = (state for mode in automaton.modes.values() for state in mode.flow or ())
            own = {*map(str, (*automaton.parameters, *automaton.inputs, *states))}
            outer = {name: text for name, text in self._texts.items() if name not in own}
            self._texts = outer | _texts(automaton)

    @property
    def given(self) -> bool:
        """Whether the file gives units at all."""
        return bool(self._texts or self._of_parts)

    @cached_property
    def _read(self) -> tuple[Mapping[str, Unit], tuple[Misread, ...]]:
        known: dict[str, Unit] = {}
        wrong: list[Misread] = []
        for name, scalar in self._texts.items():
            try:
                known[name] = read(scalar.value)
            except UnknownUnit as error:
                wrong.append(Misread(scalar, error.names, error.better))
        if "t" not in self._texts and any(n == "[time]" for unit in known.values() for n, _ in unit.powers):
            known["t"] = read("s")
        return known, tuple(wrong)

    @property
    def misread(self) -> tuple[Misread, ...]:
        """The texts that are no units."""
        return self._read[1]

    def of(self, name: str) -> Unit | None:
        """The unit of a state, a parameter, an input, an output, `t` or `since`; None where it is not known."""
        known = self._read[0]
        if "." in name:
            return known.get(name) or self._of_part(_INDEX.sub("", name))
        return known.get("t") if name == SINCE and name not in known else known.get(name)

    def _of_part(self, name: str) -> Unit | None:
        try:
            return read(self._of_parts[name]) if name in self._of_parts else None
        except UnknownUnit:  # reported with its automaton
            return None

    @cached_property
    def checked(self) -> tuple[Checked, ...]:
        """Every expression but functions, which have units where they are called."""
        return tuple(self._check(e) for e in self._expressions if e.role != "function") if self.given else ()

    def _check(self, written: SourceExpression) -> Checked:
        walk = Walk(lambda name: self._name(written.mode, name), written.scalar.value, self._functions)
        measure = walk.measure(written.tree)
        if written.role == "let":
            self._lets.setdefault(str(written.name), {})[written.mode] = measure
        return Checked(written, measure, self._expected(written), tuple(walk.misfits))

    def _expected(self, written: SourceExpression) -> Unit | None:
        own, time = self.of(str(written.unit_of or written.name)), self.of(TIME)
        if written.role == "flow":
            return None if own is None or time is None else own.times(time.to(Fraction(-1)))
        return own if written.role in _VALUES else None

    def _name(self, mode: str | None, name: str) -> Measure:
        unknown: Any_ = "unknown"
        lets = self._lets.get(name)
        if lets is None:
            return self.of(name) or unknown
        if mode is not None:
            return lets.get(mode, lets.get(None, unknown))
        first, *others = lets.values()  # an output of the whole model is read in every mode
        return first if all(other == first for other in others) else unknown


def _texts(document: ModelDocument | AutomatonDocument) -> dict[str, Scalar]:
    """What is written for the unit of each name."""
    found = {str(key): scalar for key, scalar in document.units.items() if scalar is not None}
    for key, entry in document.parameters.items():
        if isinstance(entry, ParameterEntry) and entry.unit is not None:
            found.setdefault(str(key), entry.unit)
    return found
