# pyright: basic
"""Some product modes of a system of parts, as the modes of a flat system.

An edge that leads to a product mode that is not among them is a wall there, and nothing where it has an `if`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

from hsdsl.base.functions import replaced
from hsdsl.base.parts import numbered, numbers_of, present, product_name
from hsdsl.language.expression.algebra import ONE, is_number, whole
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import Edge, HybridSystem, Initial, Mode, Surface


def flat_part(system: HybridSystem, names: Iterable[str]) -> HybridSystem:
    """The flat system of the product modes of these names; the system itself where it has no parts."""
    if not system.parts:
        return system
    start = {name: int(value) for name, value in system.initial.values if name in numbered(system.parts)}
    first = product_name(system.parts, start)
    every = tuple(dict.fromkeys((first, *names)))
    modes = tuple(_ProductMode(system, name, every).mode() for name in every)
    own = present(system.parts, start)
    values = tuple((name, value) for name, value in system.initial.values if name in own)
    return replace(system, modes=modes, initial=Initial(first, values), parts=())


class _ProductMode:
    """One product mode of a system, among ``every`` one that is made."""

    def __init__(self, system: HybridSystem, name: str, every: tuple[str, ...]) -> None:
        self.system, self.name, self.every = system, name, every
        self.whole: Mode = system.modes[0]
        self.numbers = numbers_of(system.parts, name)
        self.own = present(system.parts, self.numbers)
        self._known = {symbol(part): whole(number) for part, number in self.numbers.items()}
        self._done: dict[Any, Any] = {}

    def here(self, expression: Any) -> Any:
        """What an expression is in this product mode."""
        return None if expression is None else replaced(expression, self._known, self._done)

    def mode(self) -> Mode:
        """The mode."""
        rows = zip(self.whole.states, self.whole.flow, self.whole.flow_texts, strict=True)
        kept = [(name, self.here(flow), text) for name, flow, text in rows if name in self.own]
        walls, edges = list(filter(None, map(self._surface, self.whole.walls))), list[Edge]()
        for edge in self.whole.edges:
            surface = self._surface(edge.surface)
            made = [] if surface is None else list(self._edges(edge, surface))
            edges += made
            if surface is not None and not made and edge.condition is None:
                walls.append(replace(surface, left=surface.right, right=surface.left))
        final = any(part.final[part.number(self.numbers)] for part in self.system.parts)
        return replace(
            self.whole,
            name=self.name,
            states=tuple(name for name, _, _ in kept),
            flow=tuple(flow for _, flow, _ in kept),
            flow_texts=tuple(text for _, _, text in kept),
            walls=tuple(walls),
            edges=() if final else tuple(edges),
            outputs=tuple(map(self.here, self.whole.outputs)),
            scene=tuple(map(self.here, self.whole.scene)),
            final=final,
        )

    def _surface(self, surface: Surface) -> Surface | None:
        """A surface in this mode; None where its part is in another."""
        residual = self.here(surface.residual)
        if residual == -ONE:
            return None
        return Surface(self.here(surface.left), self.here(surface.right), residual, surface.text)

    def _edges(self, edge: Edge, surface: Surface) -> Iterator[Edge]:
        """An edge for each of the modes that it can lead to."""
        whole = replace(edge.mapped(self.here), source=self.name, surface=surface)
        values = whole.values
        for target in self.every:
            numbers = numbers_of(self.system.parts, target)
            conditions = [is_number(values[part], number) for part, number in numbers.items()]
            if any(condition == False for condition in conditions):  # noqa: E712 - SymPy's own
                continue
            kept = whole.of_states(present(self.system.parts, numbers))
            parts = [c for c in (whole.condition, *conditions) if c is not None and c != True]  # noqa: E712
            yield replace(kept, target=target, condition=all_hold(parts))


def all_hold(conditions: list[Any]) -> Any | None:
    """The condition that all of some hold; None where there are none."""
    found = None
    for condition in conditions:
        found = condition if found is None else found & condition
    return found
