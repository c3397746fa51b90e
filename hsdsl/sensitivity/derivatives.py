# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportReturnType=false
"""Derivatives of a system's expressions by its states, by time along its inputs, and by what is differentiated by."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import sympy as sp

from hsdsl.errors import UsageError
from hsdsl.expression.scope import symbol
from hsdsl.lower.switches import with_switches
from hsdsl.sensitivity.chain import Slopes, slopes
from hsdsl.sensitivity.names import Target
from hsdsl.sensitivity.overrides import Overridden, parameter_slopes
from hsdsl.sensitivity.state_names import derivative_name
from hsdsl.system import TIME, HybridSystem, Mode, SampledInput


class Derivatives:
    """The derivatives of expressions of a system; ``inputs`` are its own and those that they need."""

    def __init__(self, given: Overridden, by: Sequence[Target]) -> None:
        self.system: HybridSystem = given.system
        self.columns = range(len(by))
        self._by = by
        self._known = parameter_slopes(given, by)
        self._linear = [i.name for i in given.system.inputs if i.hold == "linear"]
        self.moving = [p for p, row in self._known.items() if any(slope != 0 for slope in row)]
        self.inputs: list[SampledInput] = [*given.system.inputs]
        for sampled in given.system.inputs:
            self._differentiate(sampled)
        self._check_jumps()

    def rows(self, expressions: Sequence[sp.Expr], states: Sequence[str]) -> list[Slopes]:
        """The derivatives of each expression of states, by all that it depends on."""
        return slopes(expressions, [*{TIME: 0, **{symbol(n): 0 for n in (*states, *self._linear)}, **self._known}])

    def by(self, row: Slopes, k: int) -> sp.Expr:
        """A derivative by target k, through parameters and inputs."""
        return sp.Add(*(slope * self._known[name][k] for name, slope in row.items() if name in self._known))

    def by_time(self, row: Slopes) -> sp.Expr:
        """The derivative by time, through linear inputs as well."""
        through = (row.get(symbol(name), sp.S.Zero) * symbol(derivative_name(name, "t")) for name in self._linear)
        return sp.Add(row.get(TIME, sp.S.Zero), *through)

    def along(self, row: Slopes, mode: Mode) -> sp.Expr:
        """The derivative of an expression along the flow of a mode."""
        flow = zip(map(symbol, mode.states), mode.flow, strict=True)
        return sp.Add(self.by_time(row), *(row.get(x, sp.S.Zero) * f for x, f in flow))

    def _differentiate(self, given: SampledInput) -> None:
        """Add the derivatives of an input: by time along its pieces, and by each target where its samples move."""
        exact = [sp.sympify(v) for v in given.values]
        if given.hold == "linear":
            pairs = zip(exact, exact[1:], given.times, given.times[1:], strict=False)
            rises = [(b - a) / sp.sympify(t - s) for a, b, s, t in pairs]
            times = (given.times[0] - 1, *given.times)
            self._add(derivative_name(given.name, "t"), "zero", times, [sp.S.Zero, *rises, sp.S.Zero])
        rows = slopes(exact, self.moving)
        if any(rows):
            self._known[symbol(given.name)] = [
                self._add(derivative_name(given.name, t.label), given.hold, given.times, [self.by(r, k) for r in rows])
                for k, t in enumerate(self._by)
            ]

    def _add(self, name: str, hold, times, values) -> sp.Expr:
        if not any(values):
            return sp.S.Zero
        if all(v.is_Rational for v in values) and not any(isinstance(t, sp.Basic) for t in times):
            values = [Fraction(int(v.p), int(v.q)) for v in values]
        self.inputs.append(SampledInput(name, hold, tuple(times), tuple(values)))
        return symbol(name)

    def _check_jumps(self) -> None:
        """Refuse jumps of time whose times move with a target."""
        for given in self.system.inputs:
            if any(slopes(map(sp.sympify, given.times), self.moving)):
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
