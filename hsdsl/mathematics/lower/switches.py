# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportCallIssue=false
"""Switches of time: what jumps or bends at times that no state decides, as numbers that stay the same between them.

`floor`, `sign`, `abs`, `min`, `max` and `atan2` of time, parameters and inputs alone change their branch at times that
are known before a run. Each gets a number k_i that is constant between these times, its floor or its sign, and is
written with it as a smooth function: |u| is k u, and max(a, b) is the one of both that k names. A run then has a step
boundary at each of the times, and an expression on either side of it has derivatives up to the boundary.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import sympy as sp

from hsdsl.base.functions import absolute, atan2, floor, maximum, minimum, replaced, rewritten, sign
from hsdsl.language.expression.algebra import by_constants
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, HybridSystem, Mode
from hsdsl.mathematics.lower.straight import Definition, Gradient
from hsdsl.mathematics.program import Switch

_HALF = sp.Rational(1, 2)


@dataclass
class Switches:
    """The switches of a system, in an order in which each depends on earlier ones only.

    ``arguments`` maps the kind and argument of each switch, an expression over the file's names and earlier switches,
    to its symbol. At ``jumping`` switches the expression jumps; at the others it bends.
    """

    moving: frozenset[sp.Symbol]  # time, and inputs that move between their samples
    known: frozenset[sp.Symbol]  # parameters and inputs
    arguments: dict[tuple[str, sp.Expr], sp.Symbol] = field(default_factory=dict)
    jumping: set[sp.Symbol] = field(default_factory=set)
    _done: dict[sp.Basic, sp.Basic] = field(default_factory=dict)

    @property
    def symbols(self) -> tuple[sp.Symbol, ...]:
        """The symbols of the numbers in expressions."""
        return tuple(self.arguments.values())

    def out_of(self, expr: Any) -> Any:
        """Write an expression with switches."""
        return rewritten(expr, self._changed, self._done)

    def _changed(self, expr: sp.Basic) -> sp.Basic:
        if (branch := _BRANCHES.get(type(expr))) is None:
            return expr
        names = expr.free_symbols
        of_time = names & self.moving and names <= self.moving | self.known | set(self.symbols)
        return branch(self, *expr.args) if of_time else expr

    def number(self, kind: str, argument: sp.Expr, jumps: bool = False) -> sp.Expr:
        """The number of a switch: the floor or the sign of its argument."""
        if not argument.free_symbols & self.moving:  # what moves has cancelled
            return {"floor": floor, "sign": sign}[kind](argument)
        switch = self.arguments.setdefault((kind, argument), symbol(f"switch {len(self.arguments)}"))
        if jumps:
            self.jumping.add(switch)
        return switch

    def between(self, a: sp.Expr, b: sp.Expr) -> sp.Expr:
        """The larger of two; the other one's share is exactly zero, so that it seems to move nothing."""
        first = self.number("sign", a - b)
        return (1 + first) * a * _HALF + (1 - first) * b * _HALF

    def angle(self, y: sp.Expr, x: sp.Expr) -> sp.Expr:
        """The angle of (x, y): where x < 0 that of the opposite point, and a half turn."""
        side, behind = self.number("sign", y, jumps=True), self.number("sign", x, jumps=True)
        return side * sp.pi * (_HALF - _HALF * behind) + atan2(behind * y, behind * x)


_BRANCHES: dict[type, Callable[..., sp.Expr]] = {
    floor: lambda switches, u: switches.number("floor", u, jumps=True),
    sign: lambda switches, u: switches.number("sign", u, jumps=True),
    absolute: lambda switches, u: switches.number("sign", u) * u,
    maximum: lambda switches, a, b: switches.between(a, b),
    minimum: lambda switches, a, b: -switches.between(-a, -b),
    atan2: lambda switches, y, x: switches.angle(y, x),
}


def with_switches(system: HybridSystem) -> tuple[HybridSystem, Switches]:
    """Write a system's expressions with switches, and return these."""
    inputs = {symbol(i.name): i.hold for i in system.inputs if i.given is None}  # others may be driven from outside
    moving = frozenset({TIME, *(name for name, hold in inputs.items() if hold == "linear")})
    switches = Switches(moving, frozenset({*inputs, *system.parameter_symbols}))
    modes: list[Mode] = []
    for mode in system.modes:  # choices by parameters and states that do not flow are smooth
        still = (symbol(x) for x, f in zip(mode.states, mode.flow, strict=True) if f == 0)
        constants = frozenset((*system.parameter_symbols, *still))
        modes.append(mode.mapped(lambda expr, c=constants: switches.out_of(by_constants(expr, c))))
    return replace(system, modes=tuple(modes)), switches


def switch_programs(switches: Switches) -> tuple[Switch, ...]:
    """The switches without numbers, for a simulator."""
    return tuple(Switch(kind, switch in switches.jumping) for (kind, _), switch in switches.arguments.items())


def switch_routines(switches: Switches, mapping: dict):
    """The routines of `Program.switching`, over the symbols of generated code."""
    done: dict[sp.Basic, sp.Basic] = {}
    for i, (_, argument) in enumerate(switches.arguments):
        placed = replaced(argument, mapping, done)
        slope = Gradient((placed,), (TIME,))
        yield Definition(f"argument_{i}", (TIME,), (placed, slope.rows[0][0]), slope.statements)
        if not slope.statements and placed.is_polynomial(TIME) and not slope.rows[0][0].has(TIME):
            over, under = sp.fraction(sp.together(slope.rows[0][0]))
            yield Definition(f"line_{i}", (), (replaced(placed, {TIME: sp.S.Zero}, {}), over, under))
