"""A hybrid system lowered to numbers: straight-line routines and the data around them, free of SymPy.

This is all that `simulate` knows of a model. Names of the file appear only as strings for people; the routines know
states as ``x0, x1, ...``, parameters as ``p0, p1, ...`` and a sampled input i as the line
``a_i + b_i (t - c_i)`` of the segment that time is in, and the number ``k_i`` of a switch, which is constant on it.

A routine's text is a Python function body in which every constant that is not an integer exponent is a name
``q_N_D`` (the exact fraction N/D, ``q_mN_D`` when negative), so that each number type can put its own value there.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Literal

from hsdsl.base.graphs import Elimination, Variation, elimination, variation
from hsdsl.base.parts import Part
from hsdsl.base.samples import Hold

LOOKED_AT, HELD = 1, 2  # what the number of a contact is, 0 for none: see `Program.contacts`
CURVED = re.compile(r"\w\(|/")
ENDING = re.compile(r"\b(?:sqrt|pow|log|asin|acos|acosh|atanh)\(")  # functions without a value beyond some number
JUMPS = re.compile(r"\b(?:sign|floor|atan2|select)\(")
STEEP = ("sqrt", "asin", "acos", "acosh")
WHOLE = re.compile(r"q_m?\d+_1|\d+")
NO_FLOW = "q_0_1"
MOVING = re.compile(r"t|[xv]\d+")


@dataclass(frozen=True)
class Routines:
    """The text of one Python module function that binds data and returns a mode's routines.

    ``source`` defines ``bind(p0, ..., a0, b0, c0, ...)`` returning a tuple of functions in the order of ``names``.
    """

    names: tuple[str, ...]
    source: str


@dataclass(frozen=True)
class Operation:
    """One line of a tape: what kind of recurrence, of which earlier lines, with which constant.

    With u, v lines and c the constant, ``kind`` is ``constant`` (c), ``add`` (u + v), ``sub`` (u - v), ``neg`` (-u),
    ``offset`` (u + c), ``scale`` (c u), ``mul`` (u v), ``square`` (u u), ``div`` (u / v), ``under`` (c / u), ``sqrt``
    (of u), ``pow`` (u**c), ``slope`` (time from the point of expansion, times u'), or the name of a function of u with
    the slope of u as the second line and its derivative by u as the third; ``atan2`` has lines y and x, its derivatives
    by them, and their slopes. ``below`` is the second line where the first, which no flow changes, is below c, else the
    third. A derivative may be a later line: coefficient k asks it for those before k.

    ``degree`` is given where the series that its sum goes along (the first line, of ``div`` the second) is a polynomial
    of time alone: then no more than so many coefficients of it count. The sine of something linear in time costs one
    product a coefficient.
    """

    kind: str
    lines: tuple[int, ...]
    constant: int | None
    degree: int | None = None


@dataclass(frozen=True)
class Tape:
    """The operations that compute Taylor coefficients along a mode's flow.

    ``constants`` has two routines without arguments, ``flow`` and ``surfaces``: the values of the constants that the
    flow needs (``constant_count``), and of those that surfaces need besides (``surface_constant_count``); from the data
    that ``bind`` takes. Lines 0 to n are time and the n states, operation i is line n + 1 + i. ``flow`` has the line of
    each state's derivative, and ``surfaces`` that of each surface, None where it is kinked. The flow needs the first
    ``needed`` operations.
    """

    constants: Routines
    constant_count: int
    surface_constant_count: int
    operations: tuple[Operation, ...]
    flow: tuple[int, ...]
    surfaces: tuple[int | None, ...]
    needed: int


@dataclass(frozen=True)
class SampledInput:
    """A sampled input: exact samples, or None where they are expressions of parameters (routine ``input_i``).

    Where a flow or a surface has its slope, as of one that a sliding follows, a kink of it is a jump: it is ``sloped``.
    """

    name: str
    hold: Hold
    times: tuple[Fraction, ...] | None
    values: tuple[Fraction, ...] | None
    sloped: bool = False


@dataclass(frozen=True)
class Switch:
    """A function of time that changes its branch at times no state decides: the floor or the sign of something.

    Where it ``jumps`` its expression jumps; else it bends.
    """

    kind: Literal["floor", "sign"]
    jumps: bool


NOTHING = Routines((), "def bind():\n    return ()\n")


@dataclass(frozen=True)
class EdgeProgram:
    """An edge; indices count modes in file order.

    ``conditional`` is whether it has an `if`, written as ``condition_text``. ``changes`` are the states of the target
    that the reset gives a value, by number, written as ``change_texts``. The others keep theirs; only where the mode
    has the same states as the target are there any. ``contact`` is the number of the motion along its guard in the
    mode; None where there is none. ``push_order`` is the order of the guard's derivative, along the flow, that presses
    then; ``counts`` are states that the edge counts with, which keep their values there. Where its reset is
    ``branched``, that of `ModeProgram.held` is the branch for slow impacts. ``releases`` is the contact that an edge of
    `ModeProgram.held` ends. Of an edge that is part of an event ``of_event`` has its name, how its
    condition is written, and its options. A ``strict`` one is made beyond its surface.
    """

    name: str
    source: int
    target: int
    target_states: tuple[str, ...]
    conditional: bool
    priority: int
    text: str
    changes: tuple[int, ...]
    change_texts: tuple[str, ...]
    condition_text: str = ""
    contact: int | None = None
    push_order: int = 0
    counts: tuple[int, ...] = ()
    branched: bool = False
    releases: int | None = None
    of_event: tuple[str, ...] = ()
    strict: bool = False

    @property
    def reset_texts(self) -> tuple[str, ...]:
        """How the value of each state of the target is written: one that keeps its value by its name."""
        texts = list(self.target_states)
        for state, text in zip(self.changes, self.change_texts, strict=True):
            texts[state] = text
        return tuple(texts)


@dataclass(frozen=True)
class Jacobian:
    """Derivatives of a mode's flow by its states: of n * n, row by row, those that are not zero everywhere.

    ``routines`` has one routine, ``jacobian``, called like those of a mode, for the values at ``places``. ``order`` is
    that in which implicit steps eliminate the states; none where they solve dense systems. Where states are
    derivatives of others, ``varied`` has for each column those of the first ``own`` that it has derivatives of, and
    ``own_order`` is the order of these.
    """

    routines: Routines
    places: tuple[int, ...]
    n: int
    order: tuple[int, ...] = ()
    own: int = 0
    varied: tuple[tuple[int, ...], ...] = ()
    own_order: tuple[int, ...] = ()

    @property
    def elimination(self) -> Elimination | None:
        """The pattern of a sparse elimination."""
        return elimination(self.places, self.order) if self.order else None

    @property
    def variation(self) -> Variation | None:
        """The blocks of a system with derivatives of its states."""
        return variation(self.places, self.n, self.own, self.varied, self.own_order) if self.varied else None


@dataclass(frozen=True)
class Queue:
    """States of a mode, by number, that say of executions that wait how many do, at most so many, and the first.

    ``name`` is that of the state with their number; ``values`` are a time and what the execution gives.
    """

    name: str
    waiting: int
    values: tuple[int, ...]
    most: int


@dataclass(frozen=True)
class ModeProgram:
    """A mode: its data without numbers, and its routines.

    Surfaces are numbered edges first (file order), then walls. With n states, m surfaces and k outputs the routines,
    called as ``name(t, x0, ..., x{n-1})``, are

    ============== =========================================================================
    flow           n derivatives
    surfaces       m values r
    magnitudes     m values |L| + |R|, the part of the round-off bound that r alone cannot show
    outputs        k values, NaN where the mode does not define the output
    gradient_K     slopes of surface K by the arguments ``slopes[K]``, numbered t, x0, ...: the others are zero
    rate_K         one value, L_f r = dr/dt + grad r . f of surface K
    condition_K_I  one boolean, part I of the `if` of edge K, which holds where all its parts do
    reset_K        values of those target states that edge K ``changes``
    spread_K       the sizes of the numbers each of these is computed from, called ``spread_K(t, x..., s...)``
                   with those of the source's: s_k where x_k is copied, else the bound of the terms with
                   max(|x_k|, s_k) in them, as a negative number, which no terms read again
    ============== =========================================================================

    ``jacobian`` gives the derivatives of the flow by the states; only implicit methods need it.

    ``terms`` has one routine, ``terms``, called like a spread, for the size of the terms that each derivative of a flow
    is computed from; None where the last digits of states and time tell it: where no terms hide, and none jump.

    ``affine`` says whether every surface is an affine function of time and the states: its gradient is the same
    everywhere.

    ``tape`` gives Taylor coefficients along the flow; None where the flow is kinked (`abs`, `sign`, `min`, `max`,
    `floor`).

    ``diagnosis`` has one routine ``expression_K`` for each of ``expressions``: flows, surfaces and conditions as a
    person knows them. It finds which of them has no finite value.

    ``held`` is the number, among `Program.flows`, of this mode where guards hold the state.
    ``slides`` names the two modes between which a mode of a completion slides.
    ``measured`` numbers states whose slopes at the end of an implicit step are put into the states before the last.
    The last ``derived`` states are derivatives of the others: surfaces and conditions do not depend on them.
    ``queues`` are those of events whose executions wait. States that are ``idle`` decide no transition.
    """

    name: str
    states: tuple[str, ...]
    final: bool
    edges: tuple[EdgeProgram, ...]
    walls: tuple[str, ...]
    flow_texts: tuple[str, ...]
    routines: Routines
    slopes: tuple[tuple[int, ...], ...]
    affine: bool
    jacobian: Jacobian
    tape: Tape | None
    expressions: tuple[str, ...]
    diagnosis: Routines
    terms: Routines | None = None
    held: int | None = None
    slides: tuple[str, ...] = ()
    measured: tuple[int, ...] = ()
    derived: int = 0
    queues: tuple[Queue, ...] = ()
    idle: tuple[int, ...] = ()

    @cached_property
    def deciding(self) -> tuple[int, ...]:
        return tuple(i for i in range(len(self.states)) if i not in self.idle)

    @property
    def surfaces(self) -> range:
        """The numbers of its surfaces."""
        return range(len(self.edges) + len(self.walls))

    @cached_property
    def conditions(self) -> tuple[tuple[str, ...], ...]:
        """The names of the routines of each edge's condition."""
        parts: list[list[str]] = [[] for _ in self.edges]
        for name in self.routines.names:
            if name.startswith("condition_"):
                parts[int(name.split("_")[1])].append(name)
        return tuple(map(tuple, parts))

    @property
    def ends(self) -> bool:
        """Whether the flow has functions without a value beyond some number, such as a root."""
        return ENDING.search(self._flow_source) is not None

    @property
    def jumps(self) -> bool:
        """Whether the flow has `sign`, `floor` or `atan2`, which jump; those of time alone are boundaries of steps."""
        return JUMPS.search(self._flow_source) is not None

    @cached_property
    def still(self) -> tuple[bool, ...]:
        """Whether each state has no flow in this mode, whatever its values are."""
        (returned,) = (
            node for node in ast.walk(ast.parse(f"def flow({self._flow_source}")) if isinstance(node, ast.Return)
        )
        assert isinstance(returned.value, ast.Tuple)
        return tuple(ast.unparse(value) == NO_FLOW for value in returned.value.elts)

    @cached_property
    def steep(self) -> bool:
        """Whether the flow has functions of time or states whose slope has no bound, as roots have at zero."""
        return any(_steep(call) for call in ast.walk(ast.parse(f"def flow({self._flow_source}")))

    @cached_property
    def curved(self) -> tuple[bool, ...]:
        """Whether the reset of each edge has a function or a quotient, also by names of `let`: no polynomial does."""
        return tuple(CURVED.search(self._source(f"reset_{k}")) is not None for k in range(len(self.edges)))

    @property
    def _flow_source(self) -> str:
        return self._source("flow")

    def _source(self, name: str) -> str:
        return self.routines.source.partition(f"def {name}(")[2].partition("    def ")[0]


def _steep(call: ast.AST) -> bool:
    match call:
        case ast.Call(func=ast.Name(id=name), args=[*_, last]):
            steep = name in STEEP or (name == "pow" and not WHOLE.fullmatch(ast.unparse(last)))
            names = [node.id for node in ast.walk(call) if isinstance(node, ast.Name)]
            return steep and any(map(MOVING.fullmatch, names))
        case _:
            return False


@dataclass(frozen=True)
class Program:
    """A model as a simulator sees it.

    ``constants`` has the routines of parameters alone: ``parameter_i(p0..p{i-1})``, ``minimum_i`` and ``maximum_i``
    where the file bounds it, ``initial`` and ``until``. Where samples are not plain numbers it has ``input_i``: times,
    then values. Where the file gives them it has ``step``, ``tolerance``, ``relaxation``, ``max_transitions``,
    ``scale`` (sizes of ``scaled_states``) and ``sample_count``, ``sample_times`` or ``every``.

    ``switching`` has, for each of ``switches``, ``argument_i(t)``: what it is the floor or sign of, and the derivative
    of that by time. One that is linear in time also has ``line_i()``: its value at t = 0, and numerator and denominator
    of its slope. A switch depends on earlier ones only.

    ``contacts`` are modes with motion along their guards. Routines of such a mode take a further number for each of
    its contacts, ``d_i``, at most ``contact_count`` of them. It is `LOOKED_AT` where the surface of the contact's edge
    is the push on the guard, negative, `HELD` where the contact also constrains the flow, and else 0. Edges after
    those of the mode are where an `if` may end a contact.

    A system of parts has one mode, whose last states are the numbers of the modes of ``parts`` (`hsdsl.base.parts`).

    Where initial values use each other, ``initial_order`` has their states, each after those that it uses. In this
    order ``initial_values`` has a routine of the parameters and ``initial_states`` for each.

    ``left_out`` names the states of the file that are not here, since nothing in the slice depends on them.
    ``assumptions`` are sentences that every run tells. ``ranges`` names the states that may start in a range: then
    ``constants`` has its ends, ``least`` and ``most``, and ``initial`` the centre.
    """

    path: str
    digest: str
    title: str | None
    parameters: tuple[str, ...]
    inputs: tuple[SampledInput, ...]
    modes: tuple[ModeProgram, ...]
    outputs: tuple[str, ...]
    units: dict[str, str]
    initial_mode: int
    initial_states: tuple[str, ...]
    scheme: str | None
    method: str | None
    completion: str | None
    constants: Routines
    left_out: tuple[str, ...] = ()
    switches: tuple[Switch, ...] = ()
    switching: Routines = NOTHING
    scaled_states: tuple[str, ...] = ()
    initial_order: tuple[int, ...] = ()
    initial_values: Routines = NOTHING
    contacts: tuple[ModeProgram, ...] = ()
    parts: tuple[Part, ...] = ()
    assumptions: tuple[str, ...] = ()
    ranges: tuple[str, ...] = ()

    @property
    def flows(self) -> tuple[ModeProgram, ...]:
        """The modes, then those with motion along guards: what a kernel has routines for."""
        return self.modes + self.contacts

    @cached_property
    def mode_names(self) -> tuple[str, ...]:
        return tuple(mode.name for mode in self.modes)

    @cached_property
    def edges(self) -> tuple[EdgeProgram, ...]:
        return tuple(edge for mode in self.modes for edge in mode.edges)

    @property
    def contact_count(self) -> int:
        """How many contacts the mode with most has."""
        return max((sum(edge.contact is not None for edge in mode.edges) for mode in self.modes), default=0)

    @cached_property
    def queues(self) -> tuple[str, ...]:
        """The names of the queues of all modes, each once."""
        return tuple(dict.fromkeys(queue.name for mode in self.modes for queue in mode.queues))

    @cached_property
    def queued(self) -> int:
        """How many values the executions of the queue with most have."""
        return max((len(queue.values) for mode in self.modes for queue in mode.queues), default=0)

    @property
    def all_states(self) -> tuple[str, ...]:
        """The states of all modes and of the start, each once."""
        names = (name for mode in self.modes for name in mode.states)
        return tuple(dict.fromkeys((*names, *self.initial_states)))
