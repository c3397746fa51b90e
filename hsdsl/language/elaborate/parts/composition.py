# pyright: basic
"""The composition of parts: one mode over the states of all of them, and the numbers of their modes.

It is the product in the sense of Def. 7 without its enumeration. What differs between the modes of a part is chosen by
the number of its mode; a surface that its mode does not have is -1, inside everywhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hsdsl.base.names import SINCE
from hsdsl.base.parts import numbered
from hsdsl.language.elaborate.edges import NOWHERE, surface
from hsdsl.language.elaborate.parts.broadcast import Broadcast
from hsdsl.language.elaborate.parts.instances import Instance
from hsdsl.language.elaborate.parts.names import Board, Names
from hsdsl.language.elaborate.parts.transitions import PartTransition, transitions_of
from hsdsl.language.expression.algebra import ONE, ZERO, pick
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import Edge, Mode, Surface

MODE, FINAL = "system", "final"


@dataclass(frozen=True)
class Composition:
    """The parts of a system, all of whose names are known."""

    board: Board

    @property
    def instances(self) -> list[Instance]:
        """All instances, in file order."""
        return list(self.board.roster.instances.values())

    @property
    def states(self) -> tuple[str, ...]:
        """The states of the whole: those of the parts, then the numbers of their modes."""
        parts = [one.part for one in self.instances]
        own = (one.full(state) for one in self.instances for state in one.states)
        return (*own, *self.timers, *numbered(parts))

    @property
    def timers(self) -> tuple[str, ...]:
        """The states `since` of the instances that use it."""
        return tuple(one.full(SINCE) for one in self.instances if one.name in self.board.timed)

    def modes(self, outputs: tuple[Any | None, ...], scene: tuple[Any, ...]) -> tuple[Mode, ...]:
        """The mode of the whole, and a final one where a part has one; none where something is wrong."""
        flow = [value for one in self.instances for value in self._flow(one)]
        walls = [wall for one in self.instances for wall in self._walls(one)]
        transitions = [t for one in self.instances for t in transitions_of(self.board, one)]
        if self.board.symbols.resolver.findings.diagnostics:
            return ()
        broadcast = Broadcast(self.board, [t for t in transitions if t.listens])
        edges = [self._edge(broadcast, t) for t in transitions if not t.listens]
        flow += [(ONE, "1")] * len(self.timers)
        count = len(self.states) - len(flow)
        whole = Mode(
            name=MODE,
            states=self.states,
            flow=(*(expr for expr, _ in flow), *(ZERO for _ in range(count))),
            flow_texts=(*(text for _, text in flow), *("0" for _ in range(count))),
            walls=tuple(walls),
            edges=tuple(edges),
            outputs=outputs,
            scene=scene,
        )
        if not any(final for one in self.instances for final in one.part.final):
            return (whole,)
        return whole, Mode(FINAL, (), (), (), (), (), (None,) * len(outputs), True, scene=(None,) * len(scene))

    def _flow(self, one: Instance) -> Iterator[tuple[Any, str]]:
        """The flow of each state of an instance, zero in modes that lack it, and how it is written."""
        values: dict[str, list[Any]] = {state: [] for state in one.states}
        texts: dict[str, list[str]] = {state: [] for state in one.states}
        ended = {mode for mode, document in one.modes if document.final and document.flow is None}
        for mode, document in one.modes:
            names = Names(self.board, one, mode, one.index)
            given = {str(key): scalar for key, scalar in (document.flow or {}).items()}
            if document.flow is None and not document.final:
                key = next(key for key in one.kind.modes if key == mode)
                hint = "write `flow: {}` for a mode without states, or `final: true`"
                self.board.report_once(key, "HS304", f"the mode '{mode}' has no `flow`", hint)
            for state in one.states:
                value = self.board.value(given[state], names) if state in given else None
                values[state] += [] if mode in ended else [ZERO if value is None else value.expr]
                texts[state] += [given[state].value] if state in given else []
        for state in one.states:
            yield self._picked(one, self._filled(one, ended, values[state])), " or ".join(dict.fromkeys(texts[state]))

    @staticmethod
    def _filled(one: Instance, ended: set[str], values: list[Any]) -> list[Any]:
        """Values of all modes, of those in which nothing flows that of another."""
        rest = iter(values)
        return [values[0] if name in ended else next(rest) for name, _ in one.modes]

    def _picked(self, one: Instance, values: list[Any]) -> Any:
        return pick(symbol(one.name), values, self.board.constants)

    def _in_mode(self, one: Instance, mode: int, value: Any, elsewhere: Any) -> Any:
        """An expression in one mode of an instance, and a number in the others."""
        return self._picked(one, [value if k == mode else elsewhere for k in range(len(one.modes))])

    def _surface(self, one: Instance, mode: int, found: Surface) -> Surface:
        left, right = (self._in_mode(one, mode, side, ZERO) for side in (found.left, found.right))
        return Surface(left, right, self._in_mode(one, mode, found.residual, -ONE), found.text)

    def _walls(self, one: Instance) -> Iterator[Surface]:
        for k, (mode, document) in enumerate(one.modes):
            names = Names(self.board, one, mode, one.index)
            for scalar in document.domain:
                if self.board.is_broken(scalar, names):
                    continue
                found = surface(self.board.symbols.resolver, scalar, names.scope, "domain")
                self.board.note(scalar, names, found)
                if found is not None:
                    yield self._surface(one, k, found)

    def _edge(self, broadcast: Broadcast, made: PartTransition) -> Edge:
        one, states = made.one, self.states
        values = broadcast.changes(made)
        ends = one.part.final[made.target]
        return Edge(
            name=one.full(made.name),
            source=MODE,
            target=FINAL if ends else MODE,
            surface=self._surface(one, made.source, made.surface) if made.surface else NOWHERE,
            condition=made.condition,
            target_states=states,
            reset=tuple(values[s] if s in values else symbol(s) for s in states),
            reset_texts=tuple(made.texts.get(s, s) for s in states),
            priority=made.priority,
            condition_text=made.condition_text,
            event=made.rising,
            stays=made.stays,
            part=(one.name, made.source + 1) if one.part.is_numbered else None,
        )
