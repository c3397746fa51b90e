"""Rules about expressions that jump, have kinks or infinite slopes, or have no real value."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from hsdsl.analysis.lint.finding import Alike, Finding, Severity
from hsdsl.analysis.lint.source_expressions import SourceExpression
from hsdsl.analysis.lint.subject import Subject
from hsdsl.base.names import shown
from hsdsl.language.expression.plain import text_of
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import Mode
from hsdsl.mathematics.decisions.dynamics import Clause, Dynamics
from hsdsl.mathematics.decisions.question import UNKNOWN, Answer, Constraint, positive, zero
from hsdsl.mathematics.decisions.singularities import divisors, infinite_slopes, jumps, kinks, without_value
from hsdsl.mathematics.decisions.wording import at

_END = "end the domain before, with a guard or a wall"
_NAMES = {"flow": "the flow of '{}'", "reset": "the reset of '{}'", "when": "this surface", "domain": "this wall"}


@dataclass(frozen=True)
class _Place:
    """An expression of a mode: as written, as mathematics, and where it is evaluated."""

    dynamics: Dynamics
    mode: Mode
    written: SourceExpression
    expr: Any
    where: Sequence[Clause]

    @property
    def name(self) -> str:
        return _NAMES[self.written.role].format(self.written.name)

    def at_known_times(self, part: Any) -> bool:
        """Whether a part switches at times that no state decides, where runs have the end of a step."""
        return self.written.role != "reset" and part.free_symbols <= self.dynamics.timed

    def witness(self, conditions: Sequence[Clause], *more: Constraint) -> Answer:
        """A point of evaluation at which one of some conditions holds."""
        clauses = [(*where, *condition) for where in self.where for condition in conditions]
        return self.dynamics.ask_any(self.mode, clauses, *more)

    def at(self, answer: Answer, *about: Any) -> str:
        """The witness in words."""
        return at(self.dynamics, self.mode, answer, about)

    def finding(self, message: str, hint: str | None, answer: Answer, severity: Severity | None = None) -> Finding:
        """The finding that a witness shows."""
        return Finding(self.written.span(), message, hint, answer.decided, severity=severity)


def _places(subject: Subject, *roles: str) -> Iterator[_Place]:
    """The flows and surfaces of modes, anywhere in the domain, and resets, on their guards."""
    dynamics = subject.dynamics
    for part in subject.modes:
        mode, where = part.mode, (dynamics.domain(part.mode),)
        edges = {item.index: item.edge for item in part.edges}
        for written in subject.written_in(mode.name):
            match written.role if written.role in roles else None:
                case "flow":
                    yield _Place(dynamics, mode, written, dynamics.flow(mode)[symbol(written.name)], where)
                case "when":
                    residual = dynamics.residual(edges[written.index].surface)
                    yield _Place(dynamics, mode, written, residual, where)
                case "domain":
                    yield _Place(dynamics, mode, written, dynamics.residual(mode.walls[written.index]), where)
                case "reset" if written.index in edges:
                    edge = edges[written.index]
                    value = dynamics.placed(edge.reset[edge.target_states.index(written.name)])
                    yield _Place(dynamics, mode, written, value, dynamics.guard(edge) or ())
                case _:
                    pass


def jump_inside_mode(subject: Subject) -> Iterator[Finding]:
    """Find jumps of flows, surfaces and resets."""
    alike = Alike("expression")
    for place in _places(subject, *_NAMES):
        for jump in jumps(place.expr):
            answer = UNKNOWN if place.at_known_times(jump.expr) else place.witness(jump.alternatives)
            if answer.somewhere:
                message = f"{place.name} jumps {place.at(answer, *jump.expr.args)}, where `{jump.name}` does"
                hint = "make a mode of each side, with a transition where it jumps"
                alike.add((jump.expr, place.expr), place.finding(message, hint, answer))
                break
    yield from alike


def kink_inside_mode(subject: Subject) -> Iterator[Finding]:
    """Find kinks of flows."""
    alike = Alike("flow")
    for place in _places(subject, "flow"):
        for kink in kinks(place.expr):
            answer = UNKNOWN if place.at_known_times(kink.expr) else place.witness(kink.alternatives)
            if answer.somewhere:
                where = place.at(answer, *kink.expr.args)
                message = f"{place.name} has a kink {where}, where `{kink.name}` has one"
                alike.add((kink.expr, place.expr), place.finding(message, None, answer))
    yield from alike


def vanishing_divisor(subject: Subject) -> Iterator[Finding]:
    """Find divisors that vanish; a note where none is seen to change its sign."""
    alike = Alike("expression", "with this divisor")
    for place in _places(subject, *_NAMES):
        for divisor in divisors(place.expr):
            if alike.again(divisor):
                continue
            slopes = place.dynamics.gradient(place.mode, divisor)
            answer, severity = UNKNOWN, "warning"
            if slopes is not None:
                answer = place.witness([(zero(divisor),)], positive(sum(slope**2 for slope in slopes)))
            if not answer.somewhere:
                answer, severity = place.witness([(zero(divisor),)]), "note"
            if answer.somewhere:
                domain = f"in the domain of the mode '{place.mode.name}'"
                message = f"the divisor `{shown(text_of(divisor))}` here is zero {place.at(answer, divisor)}, {domain}"
                alike.add(divisor, place.finding(message, _END, answer, severity))
    yield from alike


def outside_real_domain(subject: Subject) -> Iterator[Finding]:
    """Find arguments of functions that have no real value there."""
    alike = Alike("expression", "with this argument")
    for place in _places(subject, *_NAMES):
        for argument in without_value(place.expr):
            if alike.again((argument.expr, argument.name)):
                continue
            answer = place.witness(argument.alternatives)
            if answer.somewhere:
                where = f"{place.at(answer, argument.expr)}, in the domain of the mode '{place.mode.name}'"
                message = f"{argument.name} here has no real value {where}"
                alike.add((argument.expr, argument.name), place.finding(message, _END, answer))
    yield from alike


def not_lipschitz(subject: Subject) -> Iterator[Finding]:
    """Find infinite slopes of flows where their argument changes with a state."""
    alike = Alike("expression", "with this argument")
    for place in _places(subject, "flow"):
        for argument in infinite_slopes(place.expr):
            if alike.again(argument.expr):
                continue
            changes = positive(sum(argument.expr.diff(symbol(s)) ** 2 for s in place.mode.states))
            answer = place.witness(argument.alternatives, changes)
            if answer.somewhere:
                slope = f"{argument.name} has an infinite slope"
                message = f"{place.name} is not Lipschitz {place.at(answer, argument.expr)}: {slope}"
                alike.add(argument.expr, place.finding(message, _END, answer))
    yield from alike
