# pyright: basic
"""Instances: the parts of a system by name, each with its automaton, and what is wrong with how they are given.

An automaton may be in a file of its own. Every node knows its own text, so faults there have that file's path and line.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

from hsdsl.base.names import closest, did_you_mean, shown
from hsdsl.base.parts import Part
from hsdsl.language.elaborate.symbols import KINDS, SymbolTable
from hsdsl.language.schema.documents import AutomatonDocument, InstanceDocument, PartModeDocument, SystemDocument
from hsdsl.language.source import ABSENT, Key, Scalar

MOST = 10_000  # of one name
ANY = "*"  # among names that are at fault: an instance of which automaton is not known


@dataclass(frozen=True, eq=False)
class Instance:
    """A part: its name, the key that gives it, its number where it is one of several, its automaton."""

    name: str
    key: Key
    index: int | None
    automaton: str
    kind: AutomatonDocument
    given: InstanceDocument

    @cached_property
    def part(self) -> Part:
        """Its modes and their states, by the names that they have in the whole."""
        modes = self.kind.modes
        states = tuple(tuple(map(self.full, self._states(name))) for name in modes)
        return Part(
            self.name, tuple(map(str, modes)), states, tuple(mode.final for mode in modes.values()), self.start or 0
        )

    def _states(self, mode: Key) -> list[str]:
        """The states of a mode; a final one without a flow has those of the modes that lead to it."""
        modes = self.kind.modes
        if not (modes[mode].final and modes[mode].flow is None):
            return list(map(str, modes[mode].flow or ()))
        before = [m for m in modes.values() for t in m.transitions if t.target == mode]
        return list(dict.fromkeys(str(key) for m in before for key in m.flow or ()))

    @cached_property
    def states(self) -> tuple[str, ...]:
        """The states of all its modes, by their own names."""
        return tuple(dict.fromkeys(str(key) for mode in self.kind.modes.values() for key in mode.flow or ()))

    @cached_property
    def modes(self) -> list[tuple[str, PartModeDocument]]:
        return [(str(name), mode) for name, mode in self.kind.modes.items()]

    def full(self, name: str) -> str:
        """What one of its names is called in the whole."""
        return f"{self.name}.{name}"

    @cached_property
    def starts(self) -> dict[str, Scalar]:
        """The initial values that it is given."""
        extra = self.given.initial.__pydantic_extra__ if self.given.initial else {}
        return {str(key): scalar for key, scalar in extra.items()}

    @cached_property
    def start(self) -> int | None:
        """The index of the mode it starts in; None where that is not known."""
        mode, names = self.given.initial.mode if self.given.initial else None, [*map(str, self.kind.modes)]
        if mode is None:
            return 0 if len(names) == 1 else None
        return names.index(mode.value) if mode.value in names else None


@dataclass
class Roster:
    """All instances by name; those of an automaton, and those of a name that stands for several.

    ``broken`` has the names of instances that are at fault, and reported.
    """

    instances: dict[str, Instance] = field(default_factory=dict)
    counted: dict[str, list[Instance]] = field(default_factory=dict)
    automata: dict[str, list[Instance]] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)

    @property
    def names(self) -> list[str]:
        """What a sum may range over."""
        return list(dict.fromkeys((*self.counted, *self.automata)))

    def is_broken(self, name: str) -> bool:
        """Whether what a name stands for is at fault, and reported."""
        return name in self.broken or (name in self.automata and not self.group(name) and ANY in self.broken)

    def group(self, name: str) -> list[Instance] | None:
        """The instances that a name stands for in a sum."""
        alone = self.instances.get(name)
        return self.automata.get(name) or self.counted.get(name) or ([alone] if alone else None)


def roster_of(symbols: SymbolTable, document: SystemDocument) -> Roster:
    """Every instance of a system."""
    roster = Roster(automata={str(name): [] for name in document.automata})
    for name, kind in document.automata.items():
        if isinstance(kind, AutomatonDocument):
            _check_names(symbols, name, kind)
    for key, given in document.system.items():
        label = given.automaton.value
        if label not in document.automata and label != ABSENT:
            message = f"there is no automaton '{shown(label)}'"
            symbols.report(given.automaton.place, "HS350", message, did_you_mean(label, document.automata))
            label = closest(label, map(str, document.automata)) or label  # so what it means is examined, too
        kind = document.automata.get(label)  # pyright: ignore[reportArgumentType]
        if not isinstance(kind, AutomatonDocument):
            roster.broken |= {str(key), ANY}
            continue
        taken = symbols.names.get(str(key))
        if taken is not None:
            message = f"'{key}' is an instance here, and also {KINDS[taken]}"
            symbols.report(key.place, "HS301", message, "give one of them another name")
        if not kind.modes:
            roster.broken |= {str(key), ANY}
            continue
        count, made = given.count, [Instance(str(key), key, None, label, kind, given)]
        if count is not None:
            numbers = range(1, count + 1) if count <= MOST else ()
            made = [Instance(f"{key}[{k}]", key, k, label, kind, given) for k in numbers]
        if not made:
            symbols.report(key.place, "HS321", f"`count`: expected a number from 1 to {MOST:,}, got {count}")
        roster.instances |= {one.name: one for one in made}
        roster.automata[label] += made
        if not made:
            roster.broken |= {str(key), ANY}
            continue
        if count is not None:
            roster.counted[str(key)] = made
        _check(symbols, made[0])
    return roster


def _check_names(symbols: SymbolTable, automaton: Key, kind: AutomatonDocument) -> None:
    """Report an automaton without modes, and a name that it gives to two things."""
    if not kind.modes:
        symbols.report(automaton.place, "HS202", f"the automaton '{automaton}' has no modes", "give it a mode")
    states = dict.fromkeys(key for mode in kind.modes.values() for key in mode.flow or ())
    taken: dict[str, str] = {}
    tables = {"parameters": kind.parameters, "inputs": kind.inputs, "states": states, "let": kind.let}
    for what, names in tables.items():
        for key in names:
            if str(key) in taken:
                message = f"'{key}' is {KINDS[what]} of '{automaton}' here, and also {taken[str(key)]}"
                symbols.report(key.place, "HS301", message, "give one of them another name")
            taken[str(key)] = KINDS[what] if what != "inputs" else "an input above"
    for mode in kind.modes.values():
        for key in mode.let:
            if key in (mode.flow or ()):
                message = f"'{key}' is a state of this mode of '{automaton}', and also a `let` name"
                symbols.report(key.place, "HS301", message, "give one of them another name")


def _check(symbols: SymbolTable, one: Instance) -> None:
    """Report what an instance lacks, and what its automaton does not have."""
    given, kind = one.given, one.kind
    lacking = [str(name) for name in kind.inputs if name not in given.inputs]
    if lacking:
        names = ", ".join(f"'{name}'" for name in lacking)
        noun, verb = ("inputs", "are") if len(lacking) > 1 else ("input", "is")
        message = f"the {noun} {names} of '{one.key}' {verb} not connected"
        hint = f"write inputs: {{{', '.join(f'{name}: ...' for name in lacking)}}}"
        symbols.report(one.key.place, "HS351", message, hint)
    for table, known, what in ((given.inputs, kind.inputs, "input"), (given.parameters, kind.parameters, "parameter")):
        for key in table:
            if key not in known:
                message = f"the automaton '{one.automaton}' has no {what} '{shown(key)}'"
                symbols.report(key.place, "HS351", message, did_you_mean(key, map(str, known)))
    if given.at_ends and given.count is None:
        symbols.report(next(iter(given.at_ends)).place, "HS351", "`at_ends` needs a `count`", "write count: 2")
    _check_start(symbols, one)


def _check_start(symbols: SymbolTable, one: Instance) -> None:
    initial = one.given.initial
    label = initial.mode if initial else None
    if one.start is None:
        if label is None:
            message = f"'{one.key}' has no initial mode"
            symbols.report(one.key.place, "HS308", message, f"write initial: {{mode: {one.part.modes[0]}, ...}}")
        elif label.value != ABSENT:
            message = f"the automaton '{one.automaton}' has no mode '{shown(label.value)}'"
            symbols.report(label.place, "HS303", message, did_you_mean(label.value, one.part.modes))
        return
    name, mode = one.modes[one.start]
    states = list(map(str, mode.flow or ()))
    given = initial.__pydantic_extra__ if initial else {}
    for key in given:
        if key not in states:
            message = f"the mode '{name}' of '{one.automaton}' has no state '{shown(key)}'"
            symbols.report(key.place, "HS308", message, did_you_mean(key, states))
    lacking = [state for state in states if state not in given]
    if lacking:
        names = ", ".join(f"'{state}'" for state in lacking)
        noun, verb = ("states", "have") if len(lacking) > 1 else ("state", "has")
        message = f"the {noun} {names} of '{one.key}' {verb} no initial value"
        symbols.report(one.key.place, "HS308", message, "add " + ", ".join(f"{state}: ..." for state in lacking))
