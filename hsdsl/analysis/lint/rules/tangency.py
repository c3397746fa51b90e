"""Rules about tangency: flows that touch a guard, and surfaces whose gradient vanishes on them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hsdsl.analysis.lint.finding import Alike, Finding
from hsdsl.analysis.lint.subject import EdgePart, ModePart, Subject
from hsdsl.language.source import Scalar
from hsdsl.language.system import Mode, Surface
from hsdsl.mathematics.decisions.dynamics import Dynamics
from hsdsl.mathematics.decisions.mode_point import ModePoint, Unsure
from hsdsl.mathematics.decisions.proof import Proof, strict
from hsdsl.mathematics.decisions.question import Answer, negative, positive, zero
from hsdsl.mathematics.decisions.singularities import jumps_in_time
from hsdsl.mathematics.decisions.smooth_pieces import pieces
from hsdsl.mathematics.decisions.wording import at, within

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
            message = f"the flow meets the guard of '{edge.edge.name}' {where}, where L_f r = 0: {how}"
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
