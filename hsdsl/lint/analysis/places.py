# pyright: basic
"""The expressions that are evaluated in a mode, with their places in the file and where in the mode that happens."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from hsdsl.expression.scope import symbol
from hsdsl.lint.analysis.singularities import Expression

if TYPE_CHECKING:
    from hsdsl.lint.subject import ModePart, Subject


def evaluated(subject: Subject, part: ModePart, roles: tuple[str, ...]) -> Iterator[Expression]:
    """The flows and surfaces of a mode, anywhere in its domain, and the resets, on their guards."""
    dynamics, mode = subject.dynamics, part.mode
    domain = (dynamics.domain(mode),)
    for written in subject.written_in(mode.name):
        if written.role not in roles:
            continue
        if written.role == "flow":
            yield Expression(written, dynamics.flow(mode)[symbol(written.name)], domain)
        elif written.role == "when":
            yield Expression(written, dynamics.residual(mode.edges[written.index].surface), domain)
        elif written.role == "domain":
            yield Expression(written, dynamics.residual(mode.walls[written.index]), domain)
        elif written.role == "reset":
            edge = mode.edges[written.index]
            value = edge.reset[edge.target_states.index(written.name)]
            yield Expression(written, dynamics.placed(value), tuple(dynamics.guard(edge) or ()))
