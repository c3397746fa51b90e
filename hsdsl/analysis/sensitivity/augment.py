# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportReturnType=false
"""A hybrid system with the derivatives of its states as further states, which any engine can run.

With x' = f along an arc, S = dx/dp obeys S' = f_x S + f_p. At a crossing of a guard r, at the rate L = L_f r, the time
of the crossing moves by T = -(r_x S + r_p) / L. A reset R to a mode with the flow g takes S to

    R_x S + R_p + (R_t + R_x f - g) T,

which is the saltation matrix where r and R depend on states alone (M. A. Aizerman and F. R. Gantmakher, Quarterly
Journal of Mechanics and Applied Mathematics 11, 1958). A transition on entry keeps the T of the instant.

Each derivative has a state of its own, and each T has one that stays as it is between transitions; those that are zero
in every run (`Dependence`) are left out.

A stiff flow is a small difference of large terms, f = k (z - x): the last digit of x is k units of it. The end of an
implicit step tells it without them, from the states' increments. So where an implicit method runs the system, L and R_x
f take slopes that the method puts into states of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import sympy as sp

from hsdsl.analysis.sensitivity.overrides import Overridden, Slopes, parameter_slopes, slopes
from hsdsl.analysis.sensitivity.targets import (
    ERROR,
    LAST,
    MEASURED,
    SPAN,
    UNIT,
    Target,
    derivative_name,
    rate_name,
    shift_name,
    slope_name,
    still_rate_name,
)
from hsdsl.base.errors import UsageError
from hsdsl.base.functions import below, maximum, replaced, sign
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode, Parameter, SampledInput, started
from hsdsl.mathematics.lower.switches import with_switches

OF_RUNS = ("scheme", "method", "step", "tolerance", "samples", "every")  # settings that a sensitivity gives


def augmented(given: Overridden, by: Sequence[Target], entries: bool = False, implicit: bool = False) -> HybridSystem:
    """Write a system with the derivatives of its states.

    ``entries`` lets it make transitions on entry; without it those of a run have the derivative of a crossing.
    With ``implicit`` an implicit method runs it, and its Jacobian has the second derivatives of the flow. Without these
    the derivatives would follow the states an iteration later, and no factors of a step would serve for the next.
    """
    return _Writer(given, by, entries, implicit).system()


def preferring(system: HybridSystem, firsts: Sequence[str]) -> HybridSystem:
    """The system in which some edges go before others that are tied with them."""
    if not firsts:
        return system
    highest = 1 + max(edge.priority for edge in system.edges)
    modes = (
        replace(m, edges=tuple(replace(e, priority=highest) if e.name in firsts else e for e in m.edges))
        for m in system.modes
    )
    return replace(system, modes=tuple(modes))


class _Writer:
    def __init__(self, given: Overridden, by: Sequence[Target], entries: bool, implicit: bool) -> None:
        self.base, self.labels, self.entries = given.system, [t.label for t in by], entries
        self.implicit, self.ends_at_rest = implicit, any(not mode.states for mode in self.base.modes)
        self.of = Derivatives(given, by)
        # The derivatives of the initial state that are not zero
        found: dict[tuple[str, int], sp.Expr] = {}
        earlier: list[sp.Symbol] = []
        for name, value in given.system.initial.in_order:
            (row,) = slopes([value], [*self.of.moving, *earlier])
            earlier.append(symbol(name))
            for k, target in enumerate(by):
                through = (row[x] * found.get((x.name, k), sp.S.Zero) for x in earlier if x in row)
                slope = sp.S.Zero if name in given.placed else sp.Add(self.of.by(row, k), *through)
                slope = sp.S.One if target.initial and target.name == name else slope
                if slope != 0:
                    found[name, k] = slope
        self.start = found
        self.dependence = Dependence(self.of, self.start, self.base.initial.mode)
        self.columns = self.of.columns
        self.flowing = {m.name: [x for x, f in zip(m.states, m.flow, strict=True) if f != 0] for m in self.base.modes}

    def system(self) -> HybridSystem:
        """The whole system."""
        base, names = self.base, [name for name, _ in self.base.initial.values]
        states = tuple(self._states(base.initial.mode, names))
        values = dict(base.initial.in_order) | {
            derivative_name(x, self.labels[k]): value for (x, k), value in self.start.items()
        }
        values |= {name: sp.S.Zero for name in states if name not in values}
        return replace(
            base,
            parameters=(*base.parameters, *(Parameter(name, sp.S.One, "1") for name in (UNIT, SPAN, ERROR))),
            inputs=tuple(self.of.inputs),
            modes=tuple(map(self._mode, base.modes)),
            outputs=tuple(self._output_names()),
            units={},
            initial=started(base.initial.mode, states, tuple(values.items())),
            experiment=replace(base.experiment, until=symbol(SPAN), **dict.fromkeys(OF_RUNS)),
            reference=(),
            scene=(),
        )

    def _states(self, mode: str, names: Sequence[str]) -> Iterator[str]:
        """The states of a mode: the model's, their derivatives, those of the last transition's time."""
        yield from names
        yield from (derivative_name(x, self.labels[k]) for k, x in self._pairs(mode, names))
        yield from (shift_name(self.labels[k]) for k in self._shifting(mode))
        if self.entries:
            yield LAST
        if measured := self._measured(mode):
            yield from (*map(slope_name, measured), MEASURED)

    def _measured(self, mode: str) -> list[str]:
        """The states of a mode whose slopes decide how its transitions move."""
        jumps = self.dependence.jumps[mode] if self.implicit and self.dependence.times else ()
        rows = [
            row for j in jumps for row in (j.guard, *(r for r, leap in zip(j.resets, j.leaps, strict=True) if leap))
        ]
        return [x for x in self.flowing[mode] if any(symbol(x) in row for row in rows)]

    def _slopes(self, mode: Mode) -> list[sp.Expr]:
        """The flow of a mode at the end of an arc, measured where it is."""
        measured, known = self._measured(mode.name), symbol(MEASURED)
        return [
            (1 - known) * f + known * symbol(slope_name(x)) if x in measured else f
            for x, f in zip(mode.states, mode.flow, strict=True)
        ]

    def _pairs(self, mode: str, names: Sequence[str]) -> list[tuple[int, str]]:
        """The derivatives that a mode has, column by column."""
        return [(k, x) for k in self.columns for x in names if (mode, x, k) in self.dependence.states]

    def _derivatives(self, mode: str, names: Sequence[str]) -> Iterator[str]:
        yield from (derivative_name(x, self.labels[k]) for k, x in self._pairs(mode, names))

    def _varied(self, mode: Mode) -> Iterator[tuple[int, ...]]:
        pairs = self._pairs(mode.name, mode.states)
        for k in self.columns if self.implicit else ():
            if column := tuple(mode.states.index(x) for j, x in pairs if j == k):
                yield column

    def _shifting(self, mode: str) -> list[int]:
        return [k for k in self.columns if (mode, k) in self.dependence.times]

    def _total(self, row: Slopes, mode: Mode, k: int) -> sp.Expr:
        """A derivative at a fixed time: g_x S + g_p."""
        moved = (
            (symbol(x), symbol(derivative_name(x, self.labels[k])))
            for j, x in self._pairs(mode.name, mode.states)
            if j == k
        )
        return sp.Add(*(row.get(x, sp.S.Zero) * s for x, s in moved), self.of.by(row, k))

    def _mode(self, mode: Mode) -> Mode:
        rows = dict(zip(mode.states, self.dependence.flows[mode.name], strict=True))
        derivatives = [self._total(rows[x], mode, k) for k, x in self._pairs(mode.name, mode.states)]
        states = tuple(self._states(mode.name, mode.states)) if mode.states else ()
        still = [sp.S.Zero] * (len(states) - len(mode.flow) - len(derivatives))
        jumps = self.dependence.jumps[mode.name]
        return replace(
            mode,
            derived=len(states) - len(mode.states),
            varied=tuple(self._varied(mode)),
            measured=tuple(map(mode.states.index, self._measured(mode.name))) if mode.states else (),
            states=states,
            flow=(*mode.flow, *derivatives, *still),
            flow_texts=(*mode.flow_texts, *(f"the {name}" for name in states[len(mode.flow) :])),
            edges=tuple(self._edge(mode, edge, jump) for edge, jump in zip(mode.edges, jumps, strict=True)),
            outputs=tuple(self._outputs(mode)),
            queues=tuple(q._replace(values=(*q.values, *self._derivatives(mode.name, q.values))) for q in mode.queues),
            scene=(),
        )

    def _output_names(self) -> Iterator[str]:
        for y in self.base.outputs:
            yield from (y, rate_name(y), *([still_rate_name(y)] if self.ends_at_rest else []))
            yield from (derivative_name(y, label) for label in self.labels)

    def _outputs(self, mode: Mode) -> Iterator[sp.Expr | None]:
        rows = iter(self.of.rows([y for y in mode.outputs if y is not None], mode.states))
        for y in mode.outputs:
            if y is None:
                yield from [None] * (2 + self.ends_at_rest + len(self.labels))
            else:
                row = next(rows)
                yield from (y, self.of.along(row, mode), *([self.of.by_time(row)] if self.ends_at_rest else []))
                yield from (self._total(row, mode, k) for k in self.columns)

    def _edge(self, mode: Mode, edge: Edge, jump: Jump) -> Edge:
        shifts, entered = self._shifts(mode, edge, jump), self.dependence.entered(mode, edge)
        rows = dict(zip(edge.target_states, zip(jump.resets, jump.leaps, strict=True), strict=True))
        slopes, after = self._slopes(mode), dict(zip(edge.target_states, jump.after, strict=True))
        leaps = {
            x: self.of.along(row, mode, slopes) - after[x] if leap != 0 else leap for x, (row, leap) in rows.items()
        }
        derivatives = [
            self._total(rows[x][0], mode, k) + leaps[x] * shifts[k] for k, x in self._pairs(entered, edge.target_states)
        ]
        states = tuple(self._states(entered, edge.target_states))
        further = (*derivatives, *(shifts[k] for k in self._shifting(entered)), *([TIME] if self.entries else []))
        further = (*further, *[sp.S.Zero] * (len(states) - len(edge.reset) - len(further)))  # nothing is measured yet
        texts = (*edge.reset_texts, *(f"the {name}" for name in states[len(edge.reset) :]))
        reset = (*edge.reset, *further)
        return replace(edge, target_states=states, reset=reset, reset_texts=texts, derived=len(further))

    def _sizes(self, mode: Mode, edge: Edge, jump: Jump) -> sp.Expr:
        """The sizes of the numbers that a guard is computed from."""
        guard, surface = jump.guard, edge.surface
        terms = [surface.left, surface.right, self.of.by_time(guard) * TIME]
        terms += [guard[x] * x for x in map(symbol, mode.states) if x in guard]
        return sp.Add(*map(_size, terms))

    def _shifts(self, mode: Mode, edge: Edge, jump: Jump) -> list[sp.Expr]:
        """How fast the time of a transition moves, by each target."""
        moved = [-self._total(jump.guard, mode, k) for k in self.columns]
        # The rate at which a guard is crossed; 0 where an error of the run decides whether it is. A surface that
        # rises at the rate a and bends by b stays crossed while it moves by less than a**2 / (2 |b|)
        (bends,) = self.of.rows([jump.rate], mode.states)
        rate = self.of.along(jump.guard, mode, self._slopes(mode))
        margin = rate**2 - 2 * _size(self.of.along(bends, mode)) * symbol(ERROR) * self._sizes(mode, edge, jump)
        crossing = below(-margin, 0, rate, sp.S.Zero)
        if not self.entries or edge.condition is not None:
            return [m / crossing for m in moved]
        # 1 where the state is beyond the guard by more than round-off, or on it and does not move; else 0
        bound = 32 * symbol(UNIT) * self._sizes(mode, edge, jump) + 2 * self._tie() * _size(jump.rate)
        moves = below(-_size(jump.rate), 0, sp.S.Zero, sp.S.One)
        beyond, tie = below(bound - edge.surface.residual, 0, sp.S.One, moves), self._tie()
        earlier = maximum(sign(TIME - symbol(LAST) - tie), sp.S.Zero)  # 1 where an input's jump is what fires it
        known = self._shifting(mode.name)
        before = [symbol(shift_name(self.labels[k])) * (1 - earlier) if k in known else sp.S.Zero for k in self.columns]
        divisor = (1 - beyond) * crossing + beyond
        return [(1 - beyond) * m / divisor + beyond * b for m, b in zip(moved, before, strict=True)]

    def _tie(self) -> sp.Expr:
        return sp.Rational(1, 10**12) * (TIME + symbol(SPAN))


def _size(term: sp.Expr) -> sp.Expr:
    """The size of a number in a reset. A step has no boundary where it bends, as it has where |u| of time does."""
    return below(term, 0, -term, term)


class Jump(NamedTuple):
    """The derivatives of an edge: of its guard and each reset, the guard's rate, and R_t + R_x f - g of each state.

    ``after`` is g, the flow where the reset leads.
    """

    guard: Slopes
    resets: list[Slopes]
    rate: sp.Expr
    leaps: list[sp.Expr]
    after: list[sp.Expr]


class Dependence:
    """Which derivatives can differ from zero.

    ``states`` has (mode, state, target), ``times`` (mode, target) where the last transition may have moved on the way
    into the mode. ``flows`` and ``jumps`` have the derivatives of each mode's flow and edges.
    """

    def __init__(self, of: Derivatives, start: Iterable[tuple[str, int]], mode: str) -> None:
        self._of = of
        self._modes = {m.name: m for m in of.system.modes}
        self.flows = {m.name: of.rows(m.flow, m.states) for m in of.system.modes}
        self.jumps = {m.name: [self._jump(m, edge) for edge in m.edges] for m in of.system.modes}
        self.states = {(mode, x, k) for x, k in start}
        self.times: set[tuple[str, int]] = set()
        size = -1
        while size != (size := len(self.states) + len(self.times)):
            for m in of.system.modes:
                self._spread(m)

    def entered(self, mode: Mode, edge: Edge) -> str:
        """The mode whose states an edge leads to: a final mode without a flow has those of the mode before it."""
        return edge.target if self._modes[edge.target].states else mode.name

    def _jump(self, mode: Mode, edge: Edge) -> Jump:
        guard, *resets = self._of.rows([edge.surface.residual, *edge.reset], mode.states)
        after = self._flow_after(edge)
        leaps = [self._of.along(row, mode) - g for row, g in zip(resets, after, strict=True)]
        return Jump(guard, resets, self._of.along(guard, mode), leaps, after)

    def _flow_after(self, edge: Edge) -> list:
        """The flow of the target where the reset leads; that of a final mode without one is zero."""
        target = self._modes[edge.target]
        if not target.states:
            return [sp.S.Zero] * len(edge.reset)
        at = {symbol(x): value for x, value in edge.values.items()}
        return [replaced(f, at, done) for done in [{}] for f in target.flow]

    def _spread(self, mode: Mode) -> None:
        """Add what depends on what is known to differ from zero."""
        for k in self._of.columns:
            for x, row in zip(mode.states, self.flows[mode.name], strict=True):
                if self._depends(row, mode, k):
                    self.states.add((mode.name, x, k))
            for edge, jump in zip(mode.edges, self.jumps[mode.name], strict=True):
                entered = self.entered(mode, edge)
                moves = self._depends(jump.guard, mode, k) or (mode.name, k) in self.times
                if moves:
                    self.times.add((entered, k))
                for x, row, leap in zip(edge.target_states, jump.resets, jump.leaps, strict=True):
                    if self._depends(row, mode, k) or (moves and leap != 0):
                        self.states.add((entered, x, k))

    def _depends(self, row: Slopes, mode: Mode, k: int) -> bool:
        known = (symbol(x) for x in mode.states if (mode.name, x, k) in self.states)
        return any(x in row for x in known) or self._of.by(row, k) != 0


class Derivatives:
    """The derivatives of expressions of a system; ``inputs`` are its own and those that they need."""

    def __init__(self, given: Overridden, by: Sequence[Target]) -> None:
        self.system: HybridSystem = given.system
        self.columns = range(len(by))
        self._by = by
        self._known = parameter_slopes(given, by)
        self._rises: dict[str, sp.Expr] = {}  # of linear inputs
        self.moving = [p for p, row in self._known.items() if any(slope != 0 for slope in row)]
        self.inputs: list[SampledInput] = [*given.system.inputs]
        for sampled in given.system.inputs:
            self._differentiate(sampled)
        self._check_jumps()

    def rows(self, expressions: Sequence[sp.Expr], states: Sequence[str]) -> list[Slopes]:
        """The derivatives of each expression of states, by all that it depends on."""
        return slopes(expressions, [*{TIME: 0, **{symbol(n): 0 for n in (*states, *self._rises)}, **self._known}])

    def by(self, row: Slopes, k: int) -> sp.Expr:
        """A derivative by target k, through parameters and inputs."""
        return sp.Add(*(slope * self._known[name][k] for name, slope in row.items() if name in self._known))

    def by_time(self, row: Slopes) -> sp.Expr:
        """The derivative by time, through linear inputs as well."""
        through = (row.get(symbol(name), sp.S.Zero) * rise for name, rise in self._rises.items())
        return sp.Add(row.get(TIME, sp.S.Zero), *through)

    def along(self, row: Slopes, mode: Mode, slopes: Sequence[sp.Expr] | None = None) -> sp.Expr:
        """The derivative of an expression along the flow of a mode, or along slopes of its states."""
        flow = zip(map(symbol, mode.states), slopes or mode.flow, strict=True)
        return sp.Add(self.by_time(row), *(row.get(x, sp.S.Zero) * f for x, f in flow))

    def _differentiate(self, given: SampledInput) -> None:
        """Add the derivatives of an input: by time along its pieces, and by each target where its samples move."""
        times, values = ([sp.sympify(v) for v in column] for column in (given.times, given.values))
        pairs = zip(values, values[1:], times, times[1:], strict=False)
        rises = [sp.S.Zero if s == t else (b - a) / (t - s) for a, b, s, t in pairs]  # 0 of a jump, which has no piece
        if given.hold == "linear":
            name = derivative_name(given.name, "t")
            self._rises[given.name] = self._pieces(name, times, [sp.S.Zero, *rises, sp.S.Zero])
        by_times, by_values = slopes(times, self.moving), slopes(values, self.moving)
        if not any(by_times) and not any(by_values):
            return
        found: list[sp.Expr] = []
        for k, target in enumerate(self._by):
            name = derivative_name(given.name, target.label)
            shifts, lifts = ([self.by(row, k) for row in rows] for rows in (by_times, by_values))
            if given.hold == "linear" and any(shifts):
                found.append(self._moving_line(name, times, rises, shifts, lifts))
            else:
                found.append(self._add(name, given.hold, times, lifts))
        self._known[symbol(given.name)] = found

    def _moving_line(self, name: str, times, rises, shifts, lifts) -> sp.Expr:
        """The derivative, by a target, of straight lines between samples whose times move: lines that jump."""
        bends = [
            sp.S.Zero if s == t else ((b - a) - rise * (d - c)) / (t - s)
            for a, b, c, d, s, t, rise in zip(
                lifts, lifts[1:], shifts, shifts[1:], times, times[1:], rises, strict=False
            )
        ]
        levels = [v - r * h - bend * t for v, r, h, bend, t in zip(lifts, rises, shifts, bends, times, strict=False)]
        level = self._pieces(f"{name} at 0", times, [lifts[0], *levels, lifts[-1]])
        return level + TIME * self._pieces(f"{name} and t", times, [sp.S.Zero, *bends, sp.S.Zero])

    def _pieces(self, name: str, times, values) -> sp.Expr:
        """A number that stays the same between times: one value before the first, one from each of them on."""
        times = [times[0] - 1, *times]
        last = [k for k, (a, b) in enumerate(zip(times, [*times[1:], None], strict=True)) if a != b]
        return self._add(name, "zero", [times[k] for k in last], [values[k] for k in last])

    def _add(self, name: str, hold, times, values) -> sp.Expr:
        if not any(values):
            return sp.S.Zero
        both = [list(times), list(values)]
        if all(v.is_Rational for column in both for v in column):
            both = [[Fraction(int(v.p), int(v.q)) for v in column] for column in both]
        self.inputs.append(SampledInput(name, hold, *map(tuple, both)))
        return symbol(name)

    def _check_jumps(self) -> None:
        """Refuse jumps of time whose times move with a target."""
        for given in self.system.inputs:
            if any(slopes(map(sp.sympify, given.jump_times), self.moving)):
                raise _refusal(f"the sample times of input {given.name}")
        _, switches = with_switches(self.system)
        meaning = {name: argument for (_, argument), name in switches.arguments.items()}
        moving = {name for name, row in self._known.items() if any(slope != 0 for slope in row)}
        for name in switches.jumping:
            argument = meaning[name]
            while inner := argument.free_symbols & meaning.keys():
                argument = argument.xreplace({k: meaning[k] for k in inner})
            if argument.free_symbols & moving:
                raise _refusal(f"the times at which {argument} switches")


def _refusal(what: str) -> UsageError:
    return UsageError(
        f"{what} depend on what is differentiated by, and jumps at moving times are not followed",
        "write the jump as a transition: its guard may depend on t and parameters",
    )
