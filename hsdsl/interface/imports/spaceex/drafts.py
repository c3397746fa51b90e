# pyright: basic
"""Modes and transitions of a model under way, with the mathematics that decisions about them need."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from hsdsl.base.functions import replaced
from hsdsl.interface.imports.spaceex.feasibility import decide
from hsdsl.interface.imports.spaceex.formula import Relation
from hsdsl.interface.imports.spaceex.product import Arrow, Place
from hsdsl.language.expression.algebra import lie_derivative
from hsdsl.mathematics.decisions.search import Constraint, at_most_zero, zero


@dataclass(frozen=True)
class Facet:
    """An inequality of an invariant, and its excess: at most zero inside."""

    relation: Relation
    excess: Any


@dataclass
class ModeDraft:
    """A location as a mode of a model: ``lets`` are its variables that an equality of the invariant gives."""

    place: Place
    states: list[str]
    lets: dict[str, str]
    flow: dict[Any, Any]  # of symbols
    facets: list[Facet]
    equalities: list[Any]  # of states, which the flow keeps
    values: dict[Any, Any]  # of constants and lets, by symbol
    comments: list[str] = field(default_factory=list[str])

    def excess(self, relation: Relation) -> Any:
        """The excess of a relation over the states alone."""
        return self.placed(relation.excess)

    def placed(self, expr: Any) -> Any:
        """An expression over the states alone."""
        return replaced(expr, self.values, {})

    @property
    def inside(self) -> list[Constraint]:
        """The invariant."""
        return [*(at_most_zero(f.excess) for f in self.facets), *map(zero, self.equalities)]

    def kept(self, facet: Facet) -> bool:
        """Whether the flow leads back inside all over a facet, or moves nothing across it."""
        rate = lie_derivative(facet.excess, self.flow)
        return rate == 0 or decide([*self.inside, zero(facet.excess), at_most_zero(-rate)]).never


@dataclass
class TransitionDraft:
    """A transition of a model; ``facet`` is None where its surface is one of the guard, by choice."""

    arrow: Arrow
    when: Relation
    condition: list[str]
    guard: list[Constraint]
    facet: Facet | None
    comments: list[str]
