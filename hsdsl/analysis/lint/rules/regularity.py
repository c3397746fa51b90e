"""Rules about regularity: expressions that jump, have kinks, infinite slopes or no real value; tangent flows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from hsdsl.analysis.lint.finding import Alike, Finding, Severity
from hsdsl.analysis.lint.source_expressions import SourceExpression
from hsdsl.analysis.lint.subject import EdgePart, ModePart, Subject
from hsdsl.base.names import shown
from hsdsl.language.expression.plain import text_of
from hsdsl.language.expression.scope import symbol
from hsdsl.language.source import Scalar
from hsdsl.language.system import Mode, Surface
from hsdsl.mathematics.decisions.dynamics import Clause, Dynamics, Proof, at, strict, within
from hsdsl.mathematics.decisions.mode_point import ModePoint, Unsure
from hsdsl.mathematics.decisions.search import UNKNOWN, Answer, Constraint, negative, positive, zero
from hsdsl.mathematics.decisions.singularities import (
    divisors,
    infinite_slopes,
    jumps,
    jumps_in_time,
    kinks,
    pieces,
    without_value,
)

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


_GRAZES = "runs can graze it"


def tangency(subject: Subject) -> Iterator[Finding]:
    """Find guards that the flow can touch without crossing at speed."""
    dynamics = subject.dynamics
    alike = Alike("guard", "with this L_f r")
    for part, edge in subject.edges:
        residual = dynamics.residual(edge.edge.surface)
        rate = dynamics.rate(part.mode, residual)
        if rate is None or rate.is_number or alike.again(rate):
            continue
        answer = _touches(dynamics, part.mode, edge)
        if answer.somewhere:
            how, order = _contact(ModePoint(dynamics, part.mode, answer.point), residual)
            derivatives = [residual]
            for _ in range(order):
                derivatives.append(dynamics.rate(part.mode, derivatives[-1]))
            where = at(dynamics, part.mode, answer, derivatives)
            still = "where r does not change along the flow (L_f r = 0)"
            message = f"the flow meets the guard of '{edge.edge.name}' {where}, {still}: {how}"
            alike.add(rate, Finding(edge.document.when.place.span, message, None, answer.decided))
    yield from alike


def _touches(dynamics: Dynamics, mode: Mode, edge: EdgePart) -> Answer:
    """A point of the guard where the rate vanishes; one where runs graze it, if there is."""
    residual = dynamics.residual(edge.edge.surface)
    domain, conditions = dynamics.domain(mode, without=edge.edge), dynamics.condition(edge.edge) or []
    for piece in pieces(residual, dynamics.flow(mode)) or ():
        rate = None if piece.zeros else dynamics.along(piece.residual, piece.flow)
        bend = None if rate is None else dynamics.along(rate, piece.flow)
        if bend is None:
            continue
        surface = (zero(piece.residual), zero(rate), *piece.inside)
        inside = [(*surface, *strict(domain), *clause) for clause in conditions]
        answer = dynamics.ask_any(mode, inside, negative(bend))
        here = ModePoint(dynamics, mode, answer.point)
        if answer.somewhere and not here.changes_sign_nearby(bend) and _contact(here, residual)[0] == _GRAZES:
            return answer
    return dynamics.ask_any(mode, dynamics.guard(edge.edge), zero(dynamics.rate(mode, residual)))


def _contact(here: ModePoint, residual: Any) -> tuple[str, int]:
    """Say what the flow does at a point of a surface where the first derivative vanishes, and which order decides."""
    try:
        order, sign = here.first(residual)
    except Unsure:
        return "whether it crosses there was not decided (a kink, a jump, an input or a long expression)", 1
    if not sign:
        return f"all derivatives of r along the flow vanish there, up to order {order}", 1
    if order % 2:
        return f"it {'goes out' if sign > 0 else 'comes in'} there, with the derivative of order {order} alone", order
    return _GRAZES if sign < 0 else "runs come there only by resting on it, or by starting there", order


def degenerate_surface(subject: Subject) -> Iterator[Finding]:
    """Find surfaces whose function has one sign, or a gradient that vanishes on them."""
    for part in subject.modes:
        surfaces = [(edge.edge.surface, edge.document.when) for edge in part.edges]
        surfaces += zip(part.mode.walls, part.document.domain, strict=True)
        for surface, scalar in surfaces:
            yield from _degenerate(subject.dynamics, part, surface, scalar)


def _degenerate(dynamics: Dynamics, part: ModePart, surface: Surface, scalar: Scalar) -> Iterator[Finding]:
    mode, residual = part.mode, dynamics.residual(surface)
    slopes = dynamics.gradient(mode, residual)
    if slopes is None or any(slope.is_number and slope != 0 for slope in slopes):
        return
    answer = dynamics.ask(mode, (zero(residual), *(zero(slope) for slope in slopes if slope != 0)))
    if not answer.somewhere:
        return
    where = at(dynamics, mode, answer, [residual])
    carried = jumps_in_time(dynamics, residual)  # a jump onto 0 fires, as one beyond does
    for side, say in ((positive, _nowhere_positive), (negative, _nowhere_negative))[carried:]:
        proof = Proof(dynamics, mode)
        if not dynamics.ask(mode, (side(residual),)).somewhere and proof.never([(side(residual),)]):
            message = f"{say(surface.text, within(proof.searched))}, and 0 {where}"
            hint = "compare what passes through zero, not its square"
            yield Finding(scalar.place.span, message, hint, proof.decided, severity="warning")
            return
    if not residual.free_symbols <= dynamics.timed and _has_gradient(ModePoint(dynamics, mode, answer.point), residual):
        message = f"the gradient of the surface '{surface.text}' vanishes on it {where}"
        yield Finding(scalar.place.span, message, None, answer.decided, severity="note")


def _nowhere_positive(text: str, limits: str) -> str:
    return f"the surface '{text}' is {'not' if limits else 'never'} crossed{limits}: r is nowhere positive there"


def _nowhere_negative(text: str, limits: str) -> str:
    return f"every state{limits} is on or beyond the surface '{text}': r is nowhere negative there"


def _has_gradient(here: ModePoint, residual: object) -> bool:
    try:
        here.piece(residual, {})
    except Unsure:
        return False
    return True
