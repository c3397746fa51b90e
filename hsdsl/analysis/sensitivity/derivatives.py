# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportReturnType=false
"""Derivatives of a system's expressions by its states, by time along its inputs, and by what is differentiated by."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import sympy as sp

from hsdsl.analysis.sensitivity.chain import Slopes, slopes
from hsdsl.analysis.sensitivity.overrides import Overridden, parameter_slopes
from hsdsl.analysis.sensitivity.state_names import derivative_name
from hsdsl.analysis.sensitivity.targets import Target
from hsdsl.base.errors import UsageError
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, HybridSystem, Mode, SampledInput
from hsdsl.mathematics.lower.switches import with_switches


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
