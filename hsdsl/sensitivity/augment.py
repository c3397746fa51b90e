# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportReturnType=false
"""A hybrid system with the derivatives of its states as further states, which any engine can run.

With x' = f along an arc, S = dx/dp obeys S' = f_x S + f_p. At a crossing of a guard r, at the rate L = L_f r, the time
of the crossing moves by T = -(r_x S + r_p) / L. A reset R to a mode with the flow g takes S to

    R_x S + R_p + (R_t + R_x f - g) T,

which is the saltation matrix where r and R depend on states alone (M. A. Aizerman and F. R. Gantmakher, Quarterly
Journal of Mechanics and Applied Mathematics 11, 1958). A transition on entry keeps the T of the instant.

Each derivative has a state of its own, and each T has one that stays as it is between transitions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import sympy as sp

from hsdsl.errors import UsageError
from hsdsl.expression.scope import symbol
from hsdsl.functions import absolute, maximum, sign
from hsdsl.lower.straight import replaced
from hsdsl.lower.switches import with_switches
from hsdsl.sensitivity.chain import Slopes, slopes
from hsdsl.sensitivity.names import Target
from hsdsl.sensitivity.overrides import Overridden, parameter_slopes
from hsdsl.sensitivity.state_names import ERROR, LAST, SPAN, UNIT, derivative_name, rate_name, shift_name
from hsdsl.system import TIME, Edge, HybridSystem, Initial, Mode, Parameter, SampledInput


def augmented(given: Overridden, by: Sequence[Target], entries: bool = False) -> HybridSystem:
    """Write a system with the derivatives of its states.

    ``entries`` lets it make transitions on entry; without it those of a run have the derivative of a crossing.
    """
    return _Writer(given, by, entries).system()


def _refusal(what: str) -> UsageError:
    return UsageError(
        f"{what} depend on what is differentiated by, and jumps at moving times are not followed",
        "write the jump as a transition: its guard may depend on t and parameters",
    )


def preferring(system: HybridSystem, firsts: Sequence[str]) -> HybridSystem:
    """The system in which some edges go before others that are tied with them."""
    if not firsts:
        return system
    highest = 1 + max(edge.priority for mode in system.modes for edge in mode.edges)
    modes = (
        replace(m, edges=tuple(replace(e, priority=highest) if e.name in firsts else e for e in m.edges))
        for m in system.modes
    )
    return replace(system, modes=tuple(modes))


@dataclass
class _Writer:
    given: Overridden
    by: Sequence[Target]
    entries: bool

    def __post_init__(self) -> None:
        system = self.given.system
        self.modes = {mode.name: mode for mode in system.modes}
        self.parameters = parameter_slopes(self.given, self.by)
        self.moving = [p for p, row in self.parameters.items() if any(slope != 0 for slope in row)]
        self.columns = range(len(self.by))
        self.inputs, self.slopes_of_inputs = [*system.inputs], dict[sp.Symbol, list[sp.Expr]]()
        for sampled in system.inputs:
            self._differentiate(sampled)
        self._check_jumps()

    def system(self) -> HybridSystem:
        """The whole system."""
        base = self.given.system
        hidden = tuple(Parameter(name, sp.S.One, "1") for name in (UNIT, SPAN, ERROR))
        until = symbol(SPAN)
        return replace(
            base,
            parameters=(*base.parameters, *hidden),
            inputs=tuple(self.inputs),
            modes=tuple(map(self._mode, base.modes)),
            outputs=tuple(self._output_names(base.outputs)),
            units={},
            initial=self._initial(),
            experiment=replace(
                base.experiment, until=until, scheme=None, method=None, step=None, tolerance=None, samples=None
            ),
            reference=(),
            scene=(),
        )

    def _check_jumps(self) -> None:
        """Refuse jumps of time whose times move with a target."""
        moving = set(self.numbers)
        for given in self.given.system.inputs:
            if given.hold == "zero" and any(slopes(map(sp.sympify, given.times), self.moving)):
                raise _refusal(f"the sample times of input {given.name}")
        _, switches = with_switches(self.given.system)
        meaning = {name: argument for (_, argument), name in switches.arguments.items()}
        for name in switches.jumping:
            argument = meaning[name]
            while inner := argument.free_symbols & meaning.keys():
                argument = argument.xreplace({k: meaning[k] for k in inner})
            if argument.free_symbols & moving:
                raise _refusal(f"the times at which {argument} switches")

    # What a model's numbers depend on.

    def _differentiate(self, given: SampledInput) -> None:
        """Add the derivatives of an input: by time along its pieces, and by each target where its samples move."""
        name, exact = symbol(given.name), [sp.sympify(v) for v in given.values]
        if given.hold == "linear":
            pairs = zip(exact, exact[1:], given.times, given.times[1:], strict=False)
            rises = [(b - a) / sp.sympify(t - s) for a, b, s, t in pairs]
            times = (given.times[0] - 1, *given.times)
            self._add(f"d {given.name} / d t", "zero", times, [sp.S.Zero, *rises, sp.S.Zero])
        rows = slopes(exact, self.moving)
        if any(rows):
            self.slopes_of_inputs[name] = [
                self._add(f"d {given.name} / d {t.label}", given.hold, given.times, [self._by(r, k) for r in rows])
                for k, t in enumerate(self.by)
            ]

    def _add(self, name: str, hold, times, values) -> sp.Symbol:
        if all(v.is_Rational for v in values) and not any(isinstance(t, sp.Basic) for t in times):
            values = [Fraction(int(v.p), int(v.q)) for v in values]
        self.inputs.append(SampledInput(name, hold, tuple(times), tuple(values)))
        return symbol(name)

    def _by(self, row: Slopes, k: int) -> sp.Expr:
        """A derivative by a target, through parameters and inputs."""
        known = self.parameters | self.slopes_of_inputs
        return sp.Add(*(slope * known[name][k] for name, slope in row.items() if name in known))

    @property
    def numbers(self) -> list[sp.Symbol]:
        """The parameters and inputs that move with a target."""
        return [*self.moving, *self.slopes_of_inputs]

    def _by_time(self, row: Slopes) -> sp.Expr:
        """The derivative by time, through linear inputs as well."""
        linear = (i for i in self.given.system.inputs if i.hold == "linear")
        through = sp.Add(*(row.get(symbol(i.name), 0) * symbol(f"d {i.name} / d t") for i in linear))
        return row.get(TIME, sp.S.Zero) + through

    # The parts of a mode.

    def _states(self, names: Iterable[str]) -> Iterator[str]:
        yield from names
        yield from (derivative_name(x, t.label) for x in names for t in self.by)
        yield from (shift_name(t.label) for t in self.by)
        if self.entries:
            yield LAST

    def _column(self, names: Sequence[str], k: int) -> dict[sp.Symbol, sp.Symbol]:
        return {symbol(x): symbol(derivative_name(x, self.by[k].label)) for x in names}

    def _total(self, row: Slopes, states: Sequence[str], k: int) -> sp.Expr:
        """A derivative at a fixed time: g_x S + g_p."""
        along = (row.get(x, sp.S.Zero) * s for x, s in self._column(states, k).items())
        return sp.Add(*along, self._by(row, k))

    def _rows(self, expressions: Sequence[sp.Expr], states: Sequence[str]) -> list[Slopes]:
        linear = [symbol(i.name) for i in self.given.system.inputs if i.hold == "linear"]
        return slopes(expressions, list(dict.fromkeys([TIME, *map(symbol, states), *self.numbers, *linear])))

    def _mode(self, mode: Mode) -> Mode:
        rows = self._rows(mode.flow, mode.states)
        derivatives = [self._total(row, mode.states, k) for row in rows for k in self.columns]
        states = tuple(self._states(mode.states)) if mode.states else ()
        still = [sp.S.Zero] * (len(states) - len(mode.flow) - len(derivatives))
        flow = (*mode.flow, *derivatives, *still)
        return replace(
            mode,
            derived=len(states) - len(mode.states),
            states=states,
            flow=flow,
            flow_texts=(*mode.flow_texts, *(f"the {name}" for name in states[len(mode.flow) :])),
            edges=tuple(self._edge(mode, edge) for edge in mode.edges),
            outputs=tuple(self._outputs(mode)),
            scene=(),
        )

    def _output_names(self, names: Iterable[str]) -> Iterator[str]:
        for y in names:
            yield from (y, rate_name(y), *(derivative_name(y, t.label) for t in self.by))

    def _outputs(self, mode: Mode) -> Iterator[sp.Expr | None]:
        rows = iter(self._rows([y for y in mode.outputs if y is not None], mode.states))
        flow = dict(zip(map(symbol, mode.states), mode.flow, strict=True))
        for y in mode.outputs:
            if y is None:
                yield from [None] * (2 + len(self.by))
            else:
                row = next(rows)
                yield from (y, self._along(row, flow), *(self._total(row, mode.states, k) for k in self.columns))

    def _edge(self, mode: Mode, edge: Edge) -> Edge:
        residual = sp.sympify(edge.surface.residual)
        (guard, *resets) = self._rows([residual, *edge.reset], mode.states)
        flow = dict(zip(map(symbol, mode.states), mode.flow, strict=True))
        rate = self._along(guard, flow)
        after = self._flow_after(edge)
        shifts = self._shifts(mode, edge, guard, rate)
        derivatives = [
            self._total(row, mode.states, k) + (self._along(row, flow) - g) * shifts[k]
            for row, g in zip(resets, after, strict=True)
            for k in self.columns
        ]
        states = tuple(self._states(edge.target_states))
        reset = (*edge.reset, *derivatives, *shifts, *([TIME] if self.entries else []))
        texts = (*edge.reset_texts, *(f"the {name}" for name in states[len(edge.reset) :]))
        derived = len(reset) - len(edge.reset)
        return replace(edge, target_states=states, reset=reset, reset_texts=texts, derived=derived)

    def _along(self, row: Slopes, flow: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
        """The derivative of an expression along the flow."""
        return self._by_time(row) + sp.Add(*(row.get(x, sp.S.Zero) * f for x, f in flow.items()))

    def _flow_after(self, edge: Edge) -> list:
        """The flow of the target where the reset leads; that of a final mode without one is zero."""
        target = self.modes[edge.target]
        if not target.states:
            return [sp.S.Zero] * len(edge.reset)
        at = dict(zip(map(symbol, edge.target_states), map(sp.sympify, edge.reset), strict=True))
        return [replaced(sp.sympify(f), at, done) for done in [{}] for f in target.flow]

    def _rate(self, mode: Mode, edge: Edge, guard: Slopes, rate: sp.Expr) -> sp.Expr:
        """The rate at which a guard is crossed; 0 where an error of the run decides whether it is.

        A surface that rises at the rate a and bends by b stays crossed while it moves by less than a**2 / (2 |b|).
        """
        (bends,) = self._rows([rate], mode.states)
        bend = self._along(bends, dict(zip(map(symbol, mode.states), mode.flow, strict=True)))
        margin = rate**2 - 2 * absolute(bend) * symbol(ERROR) * self._sizes(mode, edge, guard)
        return rate * maximum(sign(margin), sp.S.Zero)

    def _sizes(self, mode: Mode, edge: Edge, guard: Slopes) -> sp.Expr:
        """The sizes of the numbers that a guard is computed from."""
        sizes = [absolute(edge.surface.left), absolute(edge.surface.right), absolute(self._by_time(guard) * TIME)]
        return sp.Add(*sizes, *(absolute(guard[x] * x) for x in map(symbol, mode.states) if x in guard))

    def _shifts(self, mode: Mode, edge: Edge, guard: Slopes, rate: sp.Expr) -> list[sp.Expr]:
        """How fast the time of a transition moves, by each target."""
        moved = [-self._total(guard, mode.states, k) for k in self.columns]
        crossing = self._rate(mode, edge, guard, rate)
        if not self.entries or edge.condition is not None:
            return [m / crossing for m in moved]
        beyond, tie = self._beyond(mode, edge, guard, rate), self._tie()
        earlier = maximum(sign(TIME - symbol(LAST) - tie), sp.S.Zero)  # 1 where it moved at an input's jump
        before = [symbol(shift_name(t.label)) * (1 - earlier) for t in self.by]
        divisor = (1 - beyond) * crossing + beyond
        return [(1 - beyond) * m / divisor + beyond * b for m, b in zip(moved, before, strict=True)]

    def _tie(self) -> sp.Expr:
        return sp.Rational(1, 10**12) * (TIME + symbol(SPAN))

    def _beyond(self, mode: Mode, edge: Edge, guard: Slopes, rate: sp.Expr) -> sp.Expr:
        """1 where the state is beyond the guard by more than round-off, or on it and does not move; else 0."""
        bound = 32 * symbol(UNIT) * self._sizes(mode, edge, guard) + 2 * self._tie() * absolute(rate)
        above = maximum(sign(edge.surface.residual - bound), sp.S.Zero)
        return 1 - (1 - above) * sign(rate) ** 2

    def _initial(self) -> Initial:
        base = self.given.system.initial
        names = [name for name, _ in base.values]
        rows = slopes([value for _, value in base.values], self.moving)
        first = [
            sp.S.Zero if name in self.given.placed else self._by(row, k)
            for name, row in zip(names, rows, strict=True)
            for k in self.columns
        ]
        first = [
            sp.S.One if target.initial and target.name == name else value
            for (name, target), value in zip(((n, t) for n in names for t in self.by), first, strict=True)
        ]
        still = [sp.S.Zero] * (len(self.by) + self.entries)
        values = (*(value for _, value in base.values), *first, *still)
        return Initial(base.mode, tuple(zip(self._states(names), values, strict=True)))
