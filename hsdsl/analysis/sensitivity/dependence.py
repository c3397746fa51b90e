# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false
"""What can depend on what: the derivatives of states and of transition times that are not zero in every run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import sympy as sp

from hsdsl.analysis.sensitivity.chain import Slopes
from hsdsl.analysis.sensitivity.derivatives import Derivatives
from hsdsl.base.functions import replaced
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import Edge, Mode


@dataclass(frozen=True)
class Jump:
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
