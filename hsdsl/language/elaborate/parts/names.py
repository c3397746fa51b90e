# pyright: basic
"""What names mean in a system of parts: those of an instance, then the file's, then `instance.name`.

A name is worked out when it is first used, so definitions may use each other in any order; one that comes to itself is
refused with the way it took. In initial values, names of states are those of other initial values.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any

from hsdsl.base.names import SINCE, counted, did_you_mean, shown
from hsdsl.language.elaborate.definitions import placeholders, solutions, with_solutions
from hsdsl.language.elaborate.parts.instances import Instance, Roster
from hsdsl.language.elaborate.symbols import Meanings, SymbolTable, resolved_expression
from hsdsl.language.expression import ExpressionError, algebra, parse
from hsdsl.language.expression.parse import Call, Name, Number, Sum, Tree, mapped, walk
from hsdsl.language.expression.plain import RANGES
from hsdsl.language.expression.scope import Meaning, Refusal, Scope, Value, state, symbol
from hsdsl.language.schema.documents import PartModeDocument
from hsdsl.language.source import Key, Scalar

MEMBER = re.compile(r"([^\W\d]\w*)(?:\[(.*?)\])?\.(.+)")
IN_MODE = "="  # of an attribute: 1 in the mode of that name, else 0
_SUMS = ("sum", "count")  # functions of ranges alone


@dataclass
class Board:
    """The names of a system, with what has been worked out; ``parameters`` has those of instances by full name.

    ``timed`` has the names of instances that use `since`, the time since they entered their mode.
    """

    symbols: SymbolTable
    roster: Roster
    lets: Mapping[str, Scalar]
    parameters: dict[str, Meaning] = field(default_factory=dict)
    timed: dict[str, None] = field(default_factory=dict)
    _known: dict[tuple[Any, ...], Meaning] = field(default_factory=dict)
    _indices: dict[tuple[str, int | None], int | Refusal] = field(default_factory=dict)
    _solved: dict[tuple[str, str], Meanings] = field(default_factory=dict)
    _solving: list[tuple[str, str]] = field(default_factory=list)
    _active: list[tuple[str, str]] = field(default_factory=list)
    _broken: set[tuple[str, Any, str]] = field(default_factory=set)
    _read_beyond: set[tuple[str, str]] = field(default_factory=set)  # (name of several, attribute)

    @cached_property
    def constants(self) -> frozenset[Any]:
        """The symbols of all parameters, which are known before anything chooses by them."""
        names = (*self.parameters, *(n for n, kind in self.symbols.names.items() if kind == "parameters"))
        return frozenset(map(symbol, names))

    @cached_property
    def states(self) -> frozenset[str]:
        """The states of all instances and modes, by their full names."""
        return frozenset(name for name, kind in self.symbols.names.items() if kind == "states")

    def evaluated(
        self, key: tuple[Any, ...], scalar: Scalar, names: Names, label: str, partial: bool = False
    ) -> Meaning:
        """The value of a definition, worked out once; a cycle is reported at the definition that closes it.

        A ``partial`` one has no value in modes that lack one of its names.
        """
        if key in self._known:
            return self._known[key]
        way = [name for _, name in self._active]
        if (str(key), label) in self._active:
            shown = " -> ".join((*way[way.index(label) :], label))
            message = f"'{label}' is defined by itself: {shown}"
            self.symbols.report(scalar.place, "HS352", message, "make one of them a state")
            self._known[key] = None
            return None
        self._active.append((str(key), label))
        try:
            if partial and self.lacks(scalar, names):
                message = f"'{label.rpartition('.')[2]}' has no value in the mode '{names.mode}': "
                message += "it uses a name that others define"
                value: Meaning = Refusal("HS354", message, "define that name in this mode, too, under `let`")
            else:
                value = self.value(scalar, names)
        finally:
            self._active.pop()
        return self._known.setdefault(key, value)

    def solution(self, one: Instance, mode: str, name: str) -> Meaning:
        """What an unknown of the equations of a mode is."""
        key, document = (one.name, mode), one.kind.modes[mode].solve  # pyright: ignore[reportArgumentType]
        assert document is not None
        if key in self._solving:
            message = f"the equations for '{one.full(name)}' need its own value, by way of other parts"
            self.report_once(document.equations[0], "HS352", message, "make one of them a state")
            return None
        if key not in self._solved:
            self._solving.append(key)
            try:
                names, label = Names(self, one, mode, one.index, solving=True), f"{mode} of {one.name}"
                found = solutions(self.symbols, document, names.scope, label)
            finally:
                self._solving.pop()
            self._solved[key] = {} if found is None else with_solutions(placeholders(document, label), found)
        return self._solved[key].get(name)

    def forget(self) -> None:
        """Work everything out anew."""
        self._known.clear()
        self._solved.clear()

    def value(self, scalar: Scalar, names: Names) -> Value | None:
        """The value of an expression; what another instance of the same automaton reports already is not repeated."""
        if self.is_broken(scalar, names):
            return None
        value = self.symbols.number(scalar, names.scope)
        self.note(scalar, names, value)
        return value

    def is_broken(self, scalar: Scalar, names: Names) -> bool:
        """Whether an expression is reported already, in the same mode of another instance."""
        return (scalar.place.text.path, scalar.place.start, names.mode or "") in self._broken

    def note(self, scalar: Scalar, names: Names, value: object) -> None:
        """Keep that an expression has no value."""
        if value is None:
            self._broken.add((scalar.place.text.path, scalar.place.start, names.mode or ""))

    def report_once(self, at: Scalar | Key, code: str, message: str, hint: str | None) -> None:
        """Report a fault that every instance of an automaton has."""
        place = (at.place.text.path, at.place.start, code)
        if place not in self._broken:
            self._broken.add(place)
            self.symbols.report(at.place, code, message, hint)

    def member(self, name: str, names: Names) -> Meaning:
        """What `instance.name` means; KeyError where there is no such instance."""
        found = MEMBER.fullmatch(name)
        if found is None:
            raise KeyError(name)
        base, index, attribute = found.groups()
        one = self.instance(base, index, names)
        if one is None or isinstance(one, Refusal):
            return one
        return names.beyond(base, one, attribute) if isinstance(one, int) else names.of(one, attribute)

    def instance(self, base: str, index: str | None, names: Names) -> Instance | int | Refusal | None:
        """The instance of a name; its number where that is beyond the ends. KeyError where there is none.

        None where it is at fault, and reported.
        """
        roster = self.roster
        if roster.is_broken(base):
            return None
        if index is None:
            if base in roster.instances:
                return roster.instances[base]
            if base in roster.counted or base in roster.automata:
                several = roster.counted.get(base) or roster.automata[base]
                hint = f"write {several[0].name}.NAME, or sum({base}.NAME)" if several else None
                return Refusal("HS111", f"'{base}' stands for several instances", hint)
            raise KeyError(base)
        if base not in roster.counted:
            raise KeyError(base)
        number = self._index(index, names)
        if isinstance(number, Refusal) or not 1 <= number <= len(roster.counted[base]):
            return number
        return roster.counted[base][number - 1]

    def _index(self, text: str, names: Names) -> int | Refusal:
        """The whole number that an index is."""
        key = text, names.index
        if key not in self._indices:
            self._indices[key] = self._worked_out(text, names)
        return self._indices[key]

    def _worked_out(self, text: str, names: Names) -> int | Refusal:
        known: dict[str, Meaning] = {} if names.index is None else {"index": whole_value(names.index)}
        try:
            value = resolved_expression(text, Scope(known))
        except ExpressionError as error:
            hint = "an index is a whole number, or an expression of `index` where the instance has a `count`"
            return Refusal(error.code, error.message, hint)
        if not value.expr.is_Integer:
            return Refusal("HS111", f"the index `{text}` is not a whole number", None)
        return int(value.expr)

    def at_end(self, base: str, number: int, attribute: str) -> Scalar | Refusal:
        """What a name is given as beyond the first and the last of several instances."""
        several = self.roster.counted[base]
        self._read_beyond.add((base, attribute))
        given = {str(key): scalar for key, scalar in several[0].given.at_ends.items()}
        if attribute in given:
            return given[attribute]
        message = f"there is no {base}[{number}]: '{base}' has {counted(len(several), 'instance')}"
        return Refusal("HS111", message, f"give its value under `at_ends` of '{base}': {{{attribute}: ...}}")

    def check_ends(self) -> None:
        """Report names of `at_ends` that nothing reads; to know that, everything must have been worked out."""
        for base, several in self.roster.counted.items():
            read = sorted(attribute for of, attribute in self._read_beyond if of == base)
            for key in several[0].given.at_ends:
                if str(key) not in read:
                    message = f"nothing reads '{shown(key)}' beyond the ends of '{base}'"
                    hint = did_you_mean(key, read, f"remove it, or read {base}[index - 1].{shown(key)}")
                    self.symbols.report(key.place, "HS351", message, hint)

    def of(self, one: Instance, attribute: str, lenient: bool = False) -> Meaning:
        """The value of an instance's name for other instances: a choice among its values in each mode."""
        if attribute in one.kind.parameters:
            return self.parameters.get(one.full(attribute))
        if attribute.startswith(IN_MODE):
            mode = attribute.removeprefix(IN_MODE)
            return self.picked(one, [whole_value(int(name == mode)) for name, _ in one.modes])
        key = ("of", one.name, attribute, lenient)
        if key not in self._known:
            self._known[key] = self._of(one, attribute, lenient)
        return self._known[key]

    def _of(self, one: Instance, attribute: str, lenient: bool) -> Meaning:
        known = {*one.states, *map(str, one.kind.let), *map(str, one.kind.inputs)}
        known |= {name for _, mode in one.modes for name in (*map(str, mode.let), *unknowns_of(mode))}
        if attribute not in known:
            message = f"the automaton '{one.automaton}' has no '{attribute}'"
            return Refusal("HS111", message, did_you_mean(attribute, sorted(known)))
        values: list[Value | None] = []
        for mode, document in one.modes:
            if document.flow is None and document.final:  # nothing flows there
                values.append(None)
                continue
            inner = Names(self, one, mode)
            value = inner[attribute]
            if value is None:
                return None
            lacks = not isinstance(value, Value) or not value.uses <= inner.states
            if lacks and not lenient:
                message = f"'{attribute}' has no value in the mode '{mode}' of '{one.automaton}'"
                return Refusal("HS354", message, f"define it there, too, under `let`: {{{attribute}: ...}}")
            values.append(Value(algebra.NO_VALUE) if lacks else value)  # pyright: ignore[reportArgumentType]
        return self.picked(one, values)

    def lacks(self, scalar: Scalar, names: Names) -> bool:
        """Whether an expression has a name that a mode of the instance does not define."""
        try:
            tree = names.expanded(parse(scalar.value))
        except ExpressionError:  # reported where it is worked out
            return False
        used = (names.get(node.name) for node in walk(tree) if isinstance(node, Name))
        states = names.states
        return any(
            value.code == "HS354"
            if isinstance(value, Refusal)
            else isinstance(value, Value) and not value.uses <= states
            for value in used
        )

    def picked(self, one: Instance, given: Sequence[Value | None]) -> Value:
        """One value of several, by the mode of an instance; in modes without one it is that of another."""
        known = [value for value in given if value is not None] or [whole_value(0)]
        values = [value or known[0] for value in given]
        expr = algebra.pick(symbol(one.name), [value.expr for value in values], self.constants)
        size, depth = sum(value.size for value in values), max(value.depth for value in values)
        return Value(expr, size=size, depth=depth, bits=max(value.bits for value in values))


class AllBut(Set[str]):
    """Some names without a few: of many sets of nearly all names none is written out."""

    def __init__(self, every: frozenset[str], without: frozenset[str]) -> None:
        self._every, self._without = every, without

    def __contains__(self, name: object) -> bool:
        return name in self._every and name not in self._without

    def __iter__(self) -> Iterator[str]:
        return (name for name in self._every if name not in self._without)

    def __len__(self) -> int:
        return len(self._every) - len(self._without)

    @classmethod
    def _from_iterable(cls, it: Any) -> Any:
        return frozenset(it)


def unknowns_of(mode: PartModeDocument) -> list[str]:
    """The names that the equations of a mode solve for."""
    return [] if mode.solve is None else list(map(str, mode.solve.unknowns))


@lru_cache(maxsize=4096)
def whole_value(number: int) -> Value:
    """The value of a whole number."""
    return resolved_expression(str(number), Scope({}))


@dataclass(frozen=True)
class Names(Mapping[str, Meaning]):
    """The names that can be used in one place: of an instance in a mode, of its connections, or of the file.

    ``index`` is the number of an instance, or one beyond the ends. Where ``lenient`` a name that a mode does not define
    has no value there. Where ``solving`` an unknown of the mode is a symbol of its own.
    """

    board: Board
    instance: Instance | None = None
    mode: str | None = None
    index: int | None = None
    lenient: bool = False
    solving: bool = False

    @property
    def states(self) -> Set[str]:
        """The states that may be used here, by their full names."""
        one = self.instance
        if one is None or self.mode is None:
            return self.board.states
        own = one.part.states[one.part.modes.index(self.mode)]
        return AllBut(self.board.states, frozenset(map(one.full, one.states)).difference(own))

    @property
    def scope(self) -> Scope:
        """The scope of an expression here."""
        place = "here" if self.mode is None else f"the mode '{self.mode}'"
        return Scope(self, self.states, place, expanded=self.expanded)

    def of(self, one: Instance, attribute: str) -> Meaning:
        """What a name of an instance is here."""
        return self.board.of(one, attribute, self.lenient)

    def beyond(self, base: str, number: int, attribute: str) -> Meaning:
        """What a name is beyond the first and the last of several instances."""
        given, board = self.board.at_end(base, number, attribute), self.board
        if isinstance(given, Refusal):
            return given
        key = ("at_ends", base, number, attribute)
        return board.evaluated(key, given, Names(board, index=number), f"{base}[{number}].{attribute}")

    def __getitem__(self, name: str) -> Meaning:
        if "." in name:
            return self.board.member(name, self)
        one = self.instance
        if one is not None and self.mode is not None:
            meaning = self._own(one, self.mode, name)
            if meaning is not KeyError:
                return meaning  # pyright: ignore[reportReturnType]
        if name == "index" and self.index is not None:
            return whole_value(self.index)
        if name == SINCE and self.board.symbols.timed:
            return Refusal("HS117", f"'{SINCE}' is the time since a part entered its mode", "use it in an automaton")
        if name in self.board.lets:
            outside = Names(self.board, lenient=self.lenient)
            return self.board.evaluated(("let", name, self.lenient), self.board.lets[name], outside, name)
        return self.board.symbols.values[name]

    def _own(self, one: Instance, mode: str, name: str) -> Meaning | type[KeyError]:
        """What a name means to an instance itself; the type KeyError where it means nothing."""
        if name in unknowns_of(one.kind.modes[mode]):  # pyright: ignore[reportArgumentType]
            if self.solving:
                return placeholders(one.kind.modes[mode].solve, f"{mode} of {one.name}")[name]  # pyright: ignore[reportArgumentType]
            return self.board.solution(one, mode, name)
        lets: Mapping[str, Scalar] = one.kind.modes[mode].let  # pyright: ignore[reportArgumentType, reportAssignmentType]
        shared: Mapping[str, Scalar] = one.kind.let  # pyright: ignore[reportAssignmentType]
        if name in lets or name in shared:
            scalar = lets.get(name) or shared[name]
            key = (one.name, mode, name, self.solving)
            return self.board.evaluated(key, scalar, self, one.full(name), name not in lets)
        if name in one.states:
            full = one.full(name)
            return Value(symbol(full), uses=frozenset((full,)))
        if name in one.kind.inputs:
            given: Mapping[str, Scalar] = one.given.inputs  # pyright: ignore[reportAssignmentType]
            if name not in given:
                return None  # reported with the instance
            names = Names(self.board, index=one.index)
            return self.board.evaluated((one.name, None, name), given[name], names, one.full(name))
        if name in one.kind.parameters:
            return self.board.parameters.get(one.full(name))
        if any(name in other.let or name in unknowns_of(other) for _, other in one.modes):
            hint = "give it to this mode too, or define it once in the `let` of the automaton"
            return Refusal("HS354", f"'{name}' is a `let` name of other modes", hint)
        if name == SINCE and self.board.symbols.timed:
            self.board.timed[one.name] = None
            return Value(symbol(one.full(SINCE)))
        return whole_value(one.index) if name == "index" and one.index is not None else KeyError

    def __iter__(self) -> Iterator[str]:
        one = self.instance
        if one is not None:
            yield from (*one.states, *map(str, (*one.kind.let, *one.kind.inputs, *one.kind.parameters)))
        yield from (*self.board.symbols.names, *self.board.symbols.values)
        groups = self.board.roster.automata.values()
        yield from (group[0].full(name) for group in groups if group for name in group[0].states)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def items(self) -> Any:
        """The names with their meanings, for hints: those that need working out count as states."""
        return [(name, Value(symbol(name))) for name in dict.fromkeys(self)]

    def expanded(self, tree: Tree) -> Tree:
        """The same expression with sums over instances written out."""
        if isinstance(tree, Call) and tree.function in RANGES and len(tree.arguments) == 1:
            found = self._range(tree, tree.arguments[0])
            if found is not None:
                return found
        return mapped(tree, self.expanded)

    def _range(self, tree: Call, inner: Tree) -> Tree | None:
        group = self.board.roster.group
        named = [node.name.partition(".")[::2] for node in walk(inner) if isinstance(node, Name)]
        bases = {base for base, _ in named if group(base) is not None}
        bases = {base for base in bases if base not in self.board.roster.instances} or bases
        if tree.function == "count" and isinstance(inner, Name) and bases:
            return self._count(tree, inner)
        if not bases or not all(dotted for base, dotted in named if base in bases):
            return self._no_range(tree, inner) if tree.function in _SUMS else None
        if len(bases) > 1:
            message = f"`{tree.function}` ranges over the instances of one automaton, not of {', '.join(sorted(bases))}"
            raise ExpressionError("HS113", message, tree.start, tree.end)
        (base,) = bases
        terms = [_of_instance(inner, base, one.name) for one in group(base) or []]
        if tree.function == "sum":
            return Sum(tuple((False, term) for term in terms), tree.start, tree.end)
        return replace(tree, arguments=tuple(terms)) if len(terms) > 1 else terms[0]

    def _no_range(self, tree: Call, inner: Tree) -> Tree:
        """A value that is not known where an instance is at fault, and reported; else say what the sum lacks."""
        roster, given = self.board.roster, [node for node in walk(inner) if isinstance(node, Name)]
        for node in given:
            base = node.name.partition(".")[0].partition("[")[0]
            if roster.is_broken(base):
                return Name(f"{base}.{IN_MODE}", node.start, node.end)
            if base in roster.automata and not roster.group(base):
                message = f"no instance uses the automaton '{base}'"
                raise ExpressionError("HS111", message, node.start, node.end, "give one under `system`")
            if "." in node.name and not roster.group(base):
                message = f"there is no automaton or instance '{base}'"
                raise ExpressionError("HS111", message, node.start, node.end, did_you_mean(base, roster.names))
        example = f"{tree.function}({next(iter(roster.names), 'leg')}.NAME)"
        message = f"`{tree.function}` ranges over the instances of one automaton, each by its name and a point"
        raise ExpressionError("HS113", message, tree.start, tree.end, f"write {example}")

    def _count(self, tree: Call, inner: Name) -> Tree:
        """How many instances there are, or are in a mode."""
        base, _, mode = inner.name.partition(".")
        several: list[Instance] = self.board.roster.group(base) or []
        if not mode:
            return Number(Fraction(len(several)), tree.start, tree.end)
        if mode not in several[0].part.modes:
            message = f"the automaton '{several[0].automaton}' has no mode '{mode}'"
            raise ExpressionError("HS303", message, inner.start, inner.end, did_you_mean(mode, several[0].part.modes))
        terms = [Name(f"{one.name}.{IN_MODE}{mode}", inner.start, inner.end) for one in several]
        return Sum(tuple((False, term) for term in terms), tree.start, tree.end)


def _of_instance(tree: Tree, base: str, name: str) -> Tree:
    if isinstance(tree, Name) and tree.name.partition(".")[0] == base:
        return replace(tree, name=f"{name}.{tree.name.partition('.')[2]}")
    return mapped(tree, lambda inner: _of_instance(inner, base, name))


_SENTENCE = "an initial value is an expression of parameters and of other initial values"


@dataclass
class Starts:
    """The initial values of all instances; ``written`` has each after those whose states it uses."""

    board: Board
    written: dict[str, Any] = field(default_factory=dict)
    _known: dict[str, Value | None] = field(default_factory=dict)
    _active: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.outer: Mapping[str, Meaning] = self.board.symbols.parameter_scope(_SENTENCE).values
        for one in self.board.roster.instances.values():
            for name in one.starts:
                if name in one.states:
                    self.of(one, name, False)

    def of(self, one: Instance, name: str, symbolic: bool) -> Meaning:
        """The initial value of a state of an instance, or with ``symbolic`` its symbol."""
        full, given = one.full(name), one.starts
        if name not in given:
            mode = one.part.modes[one.start or 0]
            message = f"'{name}' has no initial value where '{one.automaton}' starts in '{mode}'"
            return Refusal("HS308", message, None)
        if full not in self._known:
            if full in self._active:
                path = " -> ".join((*self._active[self._active.index(full) :], full))
                message = f"the initial value of '{full}' is defined by itself: {path}"
                self.board.symbols.report(given[name].place, "HS302", message, "give one of them by parameters")
                return None
            self._active.append(full)
            try:
                value = StartNames(self.board, one, index=one.index, starts=self).number(given[name])
                names = StartNames(self.board, one, index=one.index, starts=self, symbolic=True)
                expr = names.number(given[name]) if value is not None else None
            finally:
                self._active.pop()
            self._known.setdefault(full, value)
            if expr is not None:
                self.written[full] = expr.expr
        found = self._known[full]
        return state(full) if symbolic and found is not None else found


@dataclass(frozen=True)
class StartNames(Names):
    """The names in the initial values of an instance, or beyond the ends of several: of states their initial values."""

    starts: Starts | None = None
    symbolic: bool = False

    def number(self, scalar: Scalar) -> Value | None:
        """The value of an expression of these names."""
        scope = Scope(self, expanded=self.expanded)
        return self.board.symbols.number(scalar, scope, finite_now=not self.symbolic)

    def of(self, one: Instance, attribute: str) -> Meaning:
        """What a name of an instance is in an initial value."""
        assert self.starts is not None
        if attribute in one.kind.parameters:
            return self.board.parameters.get(one.full(attribute))
        if attribute.startswith(IN_MODE):
            return whole_value(int(one.part.modes[one.start or 0] == attribute.removeprefix(IN_MODE)))
        if attribute in one.states:
            return self.starts.of(one, attribute, self.symbolic)
        known = [*one.states, *map(str, one.kind.parameters)]
        message = f"'{attribute}' is no state or parameter of '{one.automaton}'"
        return Refusal("HS111", message, did_you_mean(attribute, known, _SENTENCE))

    def beyond(self, base: str, number: int, attribute: str) -> Meaning:
        """What a name is beyond the first and the last of several instances, in an initial value."""
        given = self.board.at_end(base, number, attribute)
        return given if isinstance(given, Refusal) else replace(self, instance=None, index=number).number(given)

    def __getitem__(self, name: str) -> Meaning:
        one, starts = self.instance, self.starts
        assert starts is not None
        if "." in name:
            return self.board.member(name, self)
        if name == "index" and self.index is not None and (one is None or name not in one.kind.parameters):
            return whole_value(self.index)
        if one is not None and (name in one.kind.parameters or name in one.states):
            return self.of(one, name)
        return starts.outer[name]

    def __iter__(self) -> Iterator[str]:
        if self.instance is not None:
            yield from (*self.instance.states, *map(str, self.instance.kind.parameters))
        yield from self.starts.outer if self.starts is not None else ()

    def items(self) -> Any:
        """The names with their meanings, for hints: states without working their values out."""
        own: Meanings = {} if self.instance is None else {name: state(name) for name in self.instance.states}
        return [*own.items(), *(self.starts.outer.items() if self.starts is not None else ())]
