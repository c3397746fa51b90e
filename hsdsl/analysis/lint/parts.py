# pyright: basic
"""Lint of systems of parts: what is found in the whole file, and each automaton as a subject of rules.

In the file these are names that nothing uses, and modes that no instance can be in. An automaton is examined as the
modes of one instance, with all that others provide as inputs: these may have any value at any time, and any rate; the
number of a mode is one of its whole numbers. Rules on what never happens are right then. Rules that find a point where
something happens look only at automata that depend on no other one.
"""

from __future__ import annotations

import re
from collections import Counter, abc
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from typing import Any

from hsdsl.analysis.lint.finding import Finding
from hsdsl.analysis.lint.source_expressions import written, written_of_automaton
from hsdsl.analysis.lint.subject import EdgePart, ModePart, Subject, edge_parts
from hsdsl.analysis.lint.units import Units
from hsdsl.base.functions import replaced
from hsdsl.base.graphs import closure
from hsdsl.base.parts import Part, numbered
from hsdsl.language.expression.algebra import whole
from hsdsl.language.expression.scope import symbol
from hsdsl.language.schema.documents import AutomatonDocument, SystemDocument
from hsdsl.language.source import Key, Mapping, Node, Scalar, Sequence, children
from hsdsl.language.system import TIME, Edge, Initial, Mode, SampledInput
from hsdsl.mathematics.decisions.dynamics import Dynamics
from hsdsl.mathematics.decisions.search import SearchRange

CODES = ("HS401", "HS402", "HS403", "HS406")
_WORD = re.compile(r"[^\W\d]\w*")
_UNUSED = "remove it, or use it"
_UNKNOWN = "some rules do not check systems of parts, and some check only automata that use nothing of other parts"


def findings_of_parts(subject: Subject, codes: abc.Sequence[str]) -> Iterator[tuple[str, Finding]]:
    """The code of each finding, and the finding; a note says which rules did not look."""
    document = subject.document
    assert isinstance(document, SystemDocument)
    used = {word for text in _texts(subject.root) for word in _WORD.findall(text)}
    found = [*_unused(document, used, "")]
    for name, kind in document.automata.items():
        if isinstance(kind, AutomatonDocument):
            found += [*_unused(kind, used, f" of '{name}'"), *_unreachable(document, name, kind)]
    yield from ((code, finding) for code, finding in found if code in codes)
    if any(code not in CODES for code in codes):
        yield "HS492", Finding(subject.root.place.span, _UNKNOWN)


def _texts(node: Node) -> Iterator[str]:
    """All values of a file, and the keys that name states of other instances."""
    if isinstance(node, Scalar):
        yield node.value
    if not isinstance(node, Mapping):
        for inner in children(node):
            yield from _texts(inner)
        return
    for key, inner in node:
        if "." in key:
            yield str(key)
        if not (
            key == "inputs" and isinstance(inner, Sequence)
        ):  # a list of names says what there is, and uses nothing
            yield from _texts(inner)


def _unused(document: SystemDocument | AutomatonDocument, used: set[str], where: str) -> Iterator[tuple[str, Finding]]:
    """Names of a file or of an automaton that nothing uses."""
    inner = document.modes.values() if isinstance(document, AutomatonDocument) else ()
    lets = [*document.let, *(key for mode in inner for key in mode.let)]
    for code, kind, names in (
        ("HS401", "parameter", document.parameters),
        ("HS402", "input", document.inputs),
        ("HS403", "`let` name", lets),
    ):
        for name in dict.fromkeys(names):
            if name not in used:
                yield code, Finding(name.place.span, f"nothing uses the {kind} '{name}'{where}", _UNUSED)


def _unreachable(document: SystemDocument, name: Key, kind: AutomatonDocument) -> Iterator[tuple[str, Finding]]:
    """Modes that no instance starts in and no transition leads to."""
    instances = [one for one in document.system.values() if one.automaton.value == name]
    if not instances:
        yield "HS406", Finding(name.place.span, f"no instance uses the automaton '{name}'", _UNUSED)
        return
    starts = {one.initial.mode.value for one in instances if one.initial and one.initial.mode}
    first = {str(mode) for mode in kind.modes if str(mode) in starts or len(kind.modes) == 1}
    leads = {str(key): [made.target or str(key) for made in mode.transitions] for key, mode in kind.modes.items()}
    entered = closure(first, leads.__getitem__)
    for key in kind.modes:
        if key not in entered:
            message = f"no instance of '{name}' can be in the mode '{key}'"
            yield "HS406", Finding(key.place.span, message, _UNUSED)


OF_UNITS = ("HS601", "HS602", "HS603", "HS604", "HS605")
OF_ALL = ("HS426", "HS427", "HS428", "HS501", *OF_UNITS)
OF_CLOSED = (*OF_ALL, "HS502", "HS506", "HS507", "HS508", "HS510")
MOST = 8  # instances of an automaton that are examined: those with other parameters or another start


def automata_of(subject: Subject) -> Iterator[AutomatonSubject]:
    """Each automaton, once for instances with equal parameters and start."""
    document, parts = subject.document, {part.name: part for part in subject.system.parts}
    assert isinstance(document, SystemDocument)
    seen, counts = set[Any](), Counter[str]()
    for key, given in document.system.items():
        kind = document.automata[given.automaton.value]  # pyright: ignore[reportArgumentType]
        assert isinstance(kind, AutomatonDocument)
        part = parts[str(key) if given.count is None else f"{key}[1]"]
        values = tuple(sorted((str(name), scalar.value) for name, scalar in given.parameters.items()))
        alike = (given.automaton.value, values, part.start)
        if alike not in seen and counts[given.automaton.value] < MOST:
            seen.add(alike)
            counts[given.automaton.value] += 1
            yield AutomatonSubject(subject, part, kind)


class AutomatonSubject(Subject):
    """The automaton of an instance, ``part``, as a model of its own."""

    def __init__(self, subject: Subject, part: Part, kind: AutomatonDocument) -> None:
        super().__init__(subject.reading)
        self.part, self.kind, self._whole = part, kind, subject.system.modes[0]
        self._own = {name for states in part.states for name in states}
        modes = tuple(self._mode(k) for k in range(len(part.modes)))
        inputs = tuple(self._input(name) for name in sorted(self._names(modes)))
        values = tuple(pair for pair in self.system.initial.values if pair[0] in part.states[part.start])
        initial = Initial(part.modes[part.start], values)
        self.foreign = frozenset(given.name for given in inputs)
        self.system = replace(
            subject.system, modes=modes, inputs=(*subject.system.inputs, *inputs), initial=initial, parts=()
        )

    @property
    def codes(self) -> tuple[str, ...]:
        """The rules that hold for it."""
        return OF_ALL if self.foreign else OF_CLOSED

    @cached_property
    def units(self) -> Units:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The units that the automaton and the file give, and those of the automaton's expressions."""
        outer = (e for e in written(self.document) if e.role in ("let", "function") and e.mode is None)
        expressions = (*outer, *written_of_automaton(self.kind))
        return Units(self.document, expressions, self.kind, self.reading.system.units)

    @property
    def edges(self) -> Iterator[tuple[ModePart, EdgePart]]:
        """Every transition with its mode whose surface others do not move by a jump."""
        return ((part, edge) for part, edge in super().edges if not self._jumps(edge.edge))

    def _jumps(self, edge: Edge) -> bool:
        used = _names_in(edge.surface.residual)
        return bool(used & (self._set_by_others | self.foreign)) or edge.source in self._joined

    @cached_property
    def modes(self) -> tuple[ModePart, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Every mode, in file order."""
        pairs = zip(self.system.modes, self.kind.modes.items(), strict=True)
        return tuple(ModePart(mode, given, key, edge_parts(mode, key, given)) for mode, (key, given) in pairs)

    @cached_property
    def dynamics(self) -> Dynamics:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Its mathematics, with anything for what others provide."""
        return _Open(self)

    @cached_property
    def _set_by_others(self) -> frozenset[str]:
        """Its states that others set, or that it sets where it fires together with them."""
        others = (edge for edge in self._whole.edges if not self._is_own(edge))
        return frozenset(state.name for edge in others for state in edge.changes) & self._own

    @cached_property
    def _joined(self) -> frozenset[str]:
        """The modes that it enters together with a transition of another part."""
        made = (made for mode in self.kind.modes.values() for made in mode.transitions)
        return frozenset(one.target for one in made if one.on is not None and one.target is not None)

    def _is_own(self, edge: Edge) -> bool:
        return edge.name.startswith(f"{self.part.name}.")

    def _names(self, modes: tuple[Mode, ...]) -> set[str]:
        """What its modes use that is not its own."""
        known = self._own | {p.name for p in self.system.parameters} | {i.name for i in self.system.inputs}
        exprs = (expr for mode in modes for expr in _expressions(mode) if expr is not None)
        return set().union(*map(_names_in, exprs)) - {TIME.name} - known

    def _input(self, name: str) -> SampledInput:
        start = dict(self.reading.system.initial.values).get(name)
        hold = "zero" if name in numbered(self.reading.system.parts) else "linear"
        return SampledInput(name, hold, (Fraction(0),), (Fraction(1) if start is None else start,))

    def _mode(self, k: int) -> Mode:
        known = {symbol(self.part.name): whole(k + 1)} if self.part.is_numbered else {}
        done: dict[Any, Any] = {}

        def here(expr: Any) -> Any:
            return replaced(expr, known, done)

        flow = dict(zip(self._whole.states, self._whole.flow, strict=True))
        states = tuple(name for name in self._whole.states if name in self.part.states[k])
        edges = (
            edge for edge in self._whole.edges if self._is_own(edge) and edge.part in (None, (self.part.name, k + 1))
        )
        walls = (wall.mapped(here) for wall in self._whole.walls)
        return Mode(
            name=self.part.modes[k],
            states=states,
            flow=tuple(here(flow[name]) for name in states),
            flow_texts=states,
            walls=tuple(wall for wall in walls if _names_in(wall.residual) & self._own),
            edges=tuple(self._edge(k, edge.mapped(here)) for edge in edges),
            outputs=(None,) * len(self.system.outputs),
            final=self.part.final[k],
        )

    def _edge(self, k: int, edge: Edge) -> Edge:
        target = int(edge.values[self.part.name]) - 1 if self.part.is_numbered else k
        modes, states = self.part.modes, self.part.states[target]
        return replace(edge.of_states(states), source=modes[k], target=modes[target])


def _names_in(expr: Any) -> set[str]:
    return {one.name for one in expr.free_symbols}


def _expressions(mode: Mode) -> Iterator[Any]:
    yield from mode.flow
    for edge in mode.edges:
        yield from (edge.condition, *edge.reset)
    for surface in mode.surfaces:
        yield surface.residual


class _Open(Dynamics):
    """The mathematics of an automaton, others being free."""

    def __init__(self, subject: AutomatonSubject) -> None:
        super().__init__(subject.system)
        self._subject = subject
        self._numbers = {part.name: len(part.modes) for part in subject.reading.system.parts}

    def _of_input(self, given: SampledInput) -> SearchRange:
        if given.name not in self._subject.foreign:
            return super()._of_input(given)
        if given.name in self._numbers:
            most = Fraction(self._numbers[given.name])
            return SearchRange(Fraction(1), most, (1.0, float(most)), 1.0)
        return SearchRange(None, None, (-10.0, 10.0), 1.0)
