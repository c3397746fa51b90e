# pyright: basic
"""A controlled hybrid system as mathematics: frozen SymPy data that checks itself at birth.

This is Definition 7 of Burden, Gonzalez, Vasudevan, Bajcsy, Sastry (2013), (J, Gamma, D, U, F, G, R), as the
language writes it down. `elaborate` makes it from a document; `lower` turns it into a SymPy-free `Program`.

The expressions of modes are SymPy objects. Every state, parameter and input is ``sympy.Symbol(name, real=True)`` with
its plain name from the file, and time is :data:`TIME`. `let` names and expression inputs have been substituted; a
sampled input stays as its symbol.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import sympy as sp

from hsdsl.base.parts import Part
from hsdsl.language.expression.conditions import Trigger
from hsdsl.language.expression.scope import TIME as TIME
from hsdsl.language.expression.scope import symbol

ZERO, HALF, ONE = sp.S.Zero, sp.S.Half, sp.S.One
TRUTH = {True: sp.true, False: sp.false}


def all_of(*conditions: Any) -> Any:
    """The Boolean that all conditions hold."""
    return sp.And(*conditions)


def at_least(left: Any, right: Any) -> Any:
    """The Boolean left >= right."""
    return sp.Ge(left, right, evaluate=False)


@dataclass(frozen=True)
class Parameter:
    """A named constant; ``value`` is an expression of earlier parameters."""

    name: str
    value: sp.Expr
    text: str
    unit: str | None = None
    minimum: sp.Expr | None = None
    maximum: sp.Expr | None = None
    about: str | None = None


def switch_parameter(name: str) -> Parameter:
    """A parameter that is 1: what it multiplies is on."""
    return Parameter(name, sp.Integer(1), "1")


@dataclass(frozen=True)
class SampledInput:
    """An input given by samples; before the first and after the last it keeps that sample's value.

    ``times`` and ``values`` are either exact numbers or expressions of parameters (never mixed with states or t).
    ``given`` is the expression of time of an input that may be driven from outside, see `elaborate.drivable`.
    """

    name: str
    hold: Literal["zero", "linear"]
    times: tuple[Fraction | sp.Expr, ...]
    values: tuple[Fraction | sp.Expr, ...]
    unit: str | None = None
    given: sp.Expr | None = None

    def __post_init__(self) -> None:
        if len(self.times) != len(self.values) or not self.times:
            raise ValueError(f"input {self.name}: as many times as values, at least one")

    @property
    def jump_times(self) -> tuple[Fraction | sp.Expr, ...]:
        """The times at which it jumps: of an input with ramps, where it has two samples at one time."""
        return self.times if self.hold == "zero" else tuple(a for a, b in pairwise(self.times) if a == b)


@dataclass(frozen=True)
class Surface:
    """One inequality ``left R right`` as a surface function r, negative inside the domain.

    For a guard ``when: L >= R`` r = L - R (crossed upwards); for a wall ``domain: L >= R`` r = R - L.
    ``left`` and ``right`` are the two sides as written, for the round-off bound 32 u (|L| + |R| + ...).
    """

    left: sp.Expr
    right: sp.Expr
    residual: sp.Expr
    text: str

    def mapped(self, change: Callable[[Any], Any]) -> Surface:
        """The surface with changed expressions."""
        return replace(self, left=change(self.left), right=change(self.right), residual=change(self.residual))


@dataclass(frozen=True)
class Event:
    """What an edge has that fires where a condition turns true, until `elaborate.events` writes it as edges.

    ``initially`` is what the condition counts as before the mode is entered. With a ``delay`` the edge is made later;
    if it is not ``persistent``, only where the condition holds until then. The states of ``given`` get values of
    before: ``at_execution`` those of where the edge is made, else those of where the condition turned true. At most
    ``waiting`` executions wait at a time. ``priority`` is an expression; None where it is the edge's.
    """

    trigger: Trigger
    text: str
    delay: sp.Expr | None = None
    persistent: bool = True
    initially: bool = True
    given: tuple[str, ...] = ()
    waiting: int = 1
    priority: sp.Expr | None = None
    options: tuple[str, ...] = ()
    at_execution: bool = False


@lru_cache(maxsize=16)  # of a large mode once, not for each of its edges
def symbols_of(states: tuple[str, ...]) -> tuple[sp.Symbol, ...]:
    """The symbols of some states."""
    return tuple(map(symbol, states))


@lru_cache(maxsize=16)
def places_of(states: tuple[str, ...]) -> dict[str, int]:
    """The numbers of some states."""
    return {name: i for i, name in enumerate(states)}


class Altered(Sequence[Any]):
    """The entries of ``kept`` but for those in ``changes``, by number.

    An edge of a large system keeps nearly all states: what it has of its own is as long as what it changes.
    """

    __slots__ = ("changes", "kept")

    def __init__(self, kept: tuple[Any, ...], changes: Mapping[int, Any]) -> None:
        self.kept = kept
        self.changes = {i: changes[i] for i in sorted(changes) if changes[i] != kept[i]}

    def __len__(self) -> int:
        return len(self.kept)

    def __getitem__(self, i: Any) -> Any:
        return tuple(self)[i] if isinstance(i, slice) else self.changes.get(range(len(self))[i], self.kept[i])

    def __iter__(self) -> Iterator[Any]:
        if not self.changes:
            return iter(self.kept)
        entries = list(self.kept)
        for i, entry in self.changes.items():
            entries[i] = entry
        return iter(entries)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Altered) and self.kept is other.kept:
            return self.changes == other.changes
        return isinstance(other, (Altered, tuple)) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(tuple(self))


def changes_of(entries: tuple[Any, ...], change: Callable[[Any], Any]) -> dict[int, Any]:
    """The entries that are changed, by number."""
    return {i: new for i, entry in enumerate(entries) if (new := change(entry)) is not entry}


@dataclass(frozen=True)
class Edge:
    """A transition: its surface, condition and reset.

    ``reset`` has one expression for each state of ``target_states`` (identity where the file names none);
    ``target_states`` are the target mode's states, or the source's where the target is final without a flow. The last
    ``derived`` of them are derivatives of others. One that ``stays`` does not enter its mode again.
    One that is part of an event has in ``of_event`` its name, how its condition is written, and its options. That of
    a ``part`` leaves the mode with this number of it. A ``strict`` one is made
    beyond its surface: not at the end of a run.
    """

    name: str
    source: str
    target: str
    surface: Surface
    condition: Any | None  # a SymPy Boolean, None where there is no `if`
    target_states: tuple[str, ...]
    reset: Altered
    reset_texts: Sequence[str]
    priority: int = 0
    derived: int = 0
    condition_text: str | None = None
    event: Event | None = None
    stays: bool = False
    of_event: tuple[str, ...] = ()
    part: tuple[str, int] | None = None
    strict: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.reset, Altered):
            altered = Altered(symbols_of(self.target_states), dict(enumerate(self.reset)))
            object.__setattr__(self, "reset", altered)

    @property
    def values(self) -> dict[str, sp.Expr]:
        """The value that each state of the target gets."""
        return dict(zip(self.target_states, self.reset, strict=True))

    @property
    def changes(self) -> dict[Any, sp.Expr]:
        """The values that are not those before, by the symbols of their states."""
        return {self.reset.kept[i]: value for i, value in self.reset.changes.items()}

    def mapped(self, change: Callable[[Any], Any], renamed: Mapping[int, Any] | None = None) -> Edge:
        """The edge with changed expressions; ``renamed`` are those of symbols that it keeps, where they are known."""
        condition = None if self.condition is None else change(self.condition)
        kept = self.reset.kept
        values = changes_of(kept, change) if renamed is None else renamed
        reset = Altered(kept, {**values, **{i: change(value) for i, value in self.reset.changes.items()}})
        return replace(self, surface=self.surface.mapped(change), condition=condition, reset=reset)

    def of_states(self, names: Container[str]) -> Edge:
        """The edge with values of these states of its target, and no others."""
        kept = [k for k, name in enumerate(self.target_states) if name in names]
        parts = ("target_states", "reset", "reset_texts")
        return replace(self, **{part: tuple(getattr(self, part)[k] for k in kept) for part in parts})


class Shape(NamedTuple):
    """A shape of the scene: its kind, how many points it has, and how many ``numbers``.

    These are the coordinates x, y of each point, and then its sizes.
    """

    kind: str
    points: int
    numbers: int


class Queue(NamedTuple):
    """States that say of the delayed executions of an event how many are ``waiting``, at most so many, and the first.

    ``values`` are the time at which the first is made and the values that it gives. The others wait elsewhere.
    """

    waiting: str
    values: tuple[str, ...]
    most: int

    def of_states(self, names: Container[str]) -> Queue:
        """The queue with values in these states, and no others."""
        return self._replace(values=tuple(name for name in self.values if name in names))


@dataclass(frozen=True)
class Mode:
    """A mode: states in file order, their flow, walls, outgoing edges in file order, outputs and scene.

    ``outputs`` has one entry for each output of the system, None where the mode does not define it. ``scene`` likewise
    has the numbers of the system's shapes, one shape after the other.
    ``slides`` names the two modes between which a mode of a completion slides. A final mode without flow has
    ``states == ()`` here: it has the states it is entered with. The last ``derived`` states are derivatives of the
    others, and the flow's Jacobian leaves out how they depend on these unless ``varied`` has them: for each column, the
    numbers of the states that it has derivatives of. What follows the last column does not flow, and no
    flow depends on it.
    The states before the last, one for each number in ``measured``, take the slopes of the states with these numbers
    where a step by an implicit method ends; the last state is then 1.
    """

    name: str
    states: tuple[str, ...]
    flow: tuple[sp.Expr, ...]
    flow_texts: tuple[str, ...]
    walls: tuple[Surface, ...]
    edges: tuple[Edge, ...]
    outputs: tuple[sp.Expr | None, ...]
    final: bool = False
    slides: tuple[str, str] | None = None
    scene: tuple[sp.Expr | None, ...] = ()
    derived: int = 0
    varied: tuple[tuple[int, ...], ...] = ()
    measured: tuple[int, ...] = ()
    queues: tuple[Queue, ...] = ()

    def __post_init__(self) -> None:
        if not len(self.states) == len(self.flow) == len(self.flow_texts):
            raise ValueError(f"mode {self.name}: one flow expression a state")

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """The surfaces of all edges, then the walls."""
        return (*(edge.surface for edge in self.edges), *self.walls)

    @cached_property
    def vector_field(self) -> dict[Any, sp.Expr]:
        """The derivative of each state, by its symbol."""
        return dict(zip(map(symbol, self.states), self.flow, strict=True))

    def mapped(self, change: Callable[[Any], Any]) -> Mode:
        """The mode with changed expressions, but those of its scene; each is changed once."""
        done: dict[int, Any] = {}  # by the objects, which last as long as this mode does
        renamed: dict[int, dict[int, Any]] = {}

        def once(expr: Any) -> Any:
            if id(expr) not in done:
                done[id(expr)] = change(expr)
            return done[id(expr)]

        def edge(of: Edge) -> Edge:
            kept = of.reset.kept
            if id(kept) not in renamed:
                renamed[id(kept)] = changes_of(kept, change)
            return of.mapped(once, renamed[id(kept)])

        return replace(
            self,
            flow=tuple(map(once, self.flow)),
            walls=tuple(wall.mapped(once) for wall in self.walls),
            edges=tuple(map(edge, self.edges)),
            outputs=tuple(None if output is None else once(output) for output in self.outputs),
        )


class Definition(NamedTuple):
    """A name that was substituted: an input that is an expression, or a `let`, of one mode where ``mode`` is given."""

    name: str
    text: str
    mode: str | None = None


class FunctionText(NamedTuple):
    """A function of the file as it was written; its calls are written out everywhere."""

    name: str
    arguments: tuple[str, ...]
    text: str


@dataclass(frozen=True)
class Initial:
    """Where a run starts: a mode and expressions of parameters for its states (file order).

    ``written`` is given where values use each other: the values over parameters and the symbols of the states whose
    values they use, each after those.
    """

    mode: str
    values: tuple[tuple[str, sp.Expr], ...]
    written: tuple[tuple[str, sp.Expr], ...] = ()

    @property
    def in_order(self) -> tuple[tuple[str, sp.Expr], ...]:
        """The values, each after those that it uses."""
        return self.written or self.values


def started(mode: str, names: Iterable[str], in_order: Sequence[tuple[str, sp.Expr]]) -> Initial:
    """Where a run starts, of values over parameters and earlier ones; ``names`` are the states in file order."""
    names, known = dict.fromkeys(names), dict[Any, Any]()
    others, written = dict[Any, Any](), list[tuple[str, Any]]()
    for name, value in in_order:
        known[symbol(name)] = sp.sympify(value).xreplace(known)
        if name in names:
            written.append((name, sp.sympify(value).xreplace(others)))
        else:
            others[symbol(name)] = sp.sympify(value).xreplace(others)
    uses = any(value.free_symbols & known.keys() for _, value in written)
    return Initial(mode, tuple((name, known[symbol(name)]) for name in names), tuple(written) if uses else ())


@dataclass(frozen=True)
class Experiment:
    """The options of the file; None for one that it does not give. Numbers are expressions of parameters.

    ``samples`` is an expression (how many equally spaced samples) or a tuple of expressions (their times); else
    ``every`` is the time between them.
    ``scale`` has the states with a given size, each with its expression.
    """

    until: sp.Expr
    scheme: str | None = None
    completion: str | None = None
    method: str | None = None
    step: sp.Expr | None = None
    tolerance: sp.Expr | None = None
    relaxation: sp.Expr | None = None
    samples: sp.Expr | tuple[sp.Expr, ...] | None = None
    every: sp.Expr | None = None
    max_transitions: sp.Expr | None = None
    scale: tuple[tuple[str, sp.Expr], ...] = ()


@dataclass(frozen=True)
class KnownTransition:
    """A transition known exactly; numbers are texts of expressions of parameters."""

    time: str
    edge: str | None = None
    before: dict[str, str] = field(default_factory=dict[str, str])
    after: dict[str, str] = field(default_factory=dict[str, str])


class KnownState(NamedTuple):
    """States and outputs known exactly at a time; numbers are texts of expressions of parameters."""

    time: str
    mode: str | None
    values: dict[str, str]


@dataclass(frozen=True)
class Reference:
    """Exact knowledge of a run with some overrides, and the bound ``trust`` on its absolute error."""

    settings: dict[str, str]
    source: str | None
    trust: str | None
    transitions: tuple[KnownTransition, ...]
    states: tuple[KnownState, ...]


@dataclass(frozen=True)
class HybridSystem:
    """A whole model. ``modes`` are in file order."""

    path: str
    digest: str  # sha256 of the model's bytes and of its CSV files
    title: str | None
    source: str | None
    parameters: tuple[Parameter, ...]
    inputs: tuple[SampledInput, ...]
    modes: tuple[Mode, ...]
    outputs: tuple[str, ...]
    units: dict[str, str]
    initial: Initial
    experiment: Experiment
    reference: tuple[Reference, ...]
    files: dict[str, bytes] = field(repr=False)  # content of the data files, by names relative to the model
    scene: tuple[Shape, ...] = ()
    parts: tuple[Part, ...] = ()  # of a composed system, whose last states are the numbers of their modes
    definitions: tuple[Definition, ...] = ()  # for people: they are substituted everywhere
    functions: tuple[FunctionText, ...] = ()
    unknowns: tuple[str, ...] = ()  # of linear equations: their solutions are substituted everywhere
    assumptions: tuple[str, ...] = ()  # sentences that every run tells
    ranges: tuple[tuple[str, sp.Expr, sp.Expr], ...] = ()  # states that start anywhere from one value to another

    def __post_init__(self) -> None:
        names = [mode.name for mode in self.modes]
        if len(set(names)) != len(names):
            raise ValueError("mode names must differ")
        for edge in self.edges:
            if edge.target not in names:
                raise ValueError(f"edge {edge.name} leads to unknown mode {edge.target}")

    @property
    def edges(self) -> tuple[Edge, ...]:
        return tuple(edge for mode in self.modes for edge in mode.edges)

    @property
    def states(self) -> tuple[str, ...]:
        """The states of all modes, each once."""
        return tuple(dict.fromkeys(name for mode in self.modes for name in mode.states))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of states, parameters, inputs, definitions and outputs."""
        given = (*self.parameters, *self.inputs, *self.definitions)
        return (*self.states, *(each.name for each in given), *self.outputs)

    @property
    def parameter_symbols(self) -> tuple[sp.Symbol, ...]:
        """The symbol of each parameter, in file order."""
        return tuple(symbol(parameter.name) for parameter in self.parameters)

    def parameter_values(self, evaluate: Callable[[sp.Expr, dict[Any, Any]], Any]) -> dict[Any, Any]:
        """The value of each parameter by its symbol: ``evaluate`` of its expression and of the values before it."""
        values: dict[Any, Any] = {}
        for parameter in self.parameters:
            values[symbol(parameter.name)] = evaluate(parameter.value, values)
        return values
