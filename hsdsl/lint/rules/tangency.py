"""A flow that can touch a guard without crossing it.

## What it does

Finds guards on which L_f r, the rate of the surface function along the flow, can vanish.

## Why it is bad

Where a run touches a guard, a run beside it misses it, and the two go different ways: what comes after depends on how
accurate the simulation is, and the error bounds hold only for runs that keep away from such points. For a stop or a
floor such points (v = 0) cannot be avoided; it is the runs near them that are to be watched.

## Example

```yaml
parameters: {x_max: 14}
modes:
  free:
    flow: {x: v, v: -x}
    transitions:
      - {when: x >= x_max, to: free, reset: {v: -v}}
initial: {mode: free, x: 0, v: 20}
```

## Use instead

A guard that the flow crosses at a speed.

```yaml
parameters: {T_max: 22}
modes:
  heating:
    flow: {T: 30 - T}
    transitions:
      - {when: T >= T_max, to: heating, reset: {T: 18}}
initial: {mode: heating, T: 20}
```

## How it is decided

A point of the guard with L_f r = 0 is looked for, symbolically or by search. The first derivative of r along the flow
that is not 0 there, up to order 6, says what the flow does: of even order and negative, runs from inside the domain
touch the surface and go back (they graze); of even order and positive, only a run that rests on the surface or starts
there comes to it, and goes out; of odd order, the flow passes without speed. At a kink or a jump nothing of that is
known. Whether a run of the model comes to the point is not looked at.

## How to fix it

Nothing has to be done where runs keep away from the point. Where they do not, look at them with a smaller tolerance,
or change the surface.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hsdsl.lint.analysis.mode_point import ModePoint, Unsure
from hsdsl.lint.analysis.proof import strict
from hsdsl.lint.analysis.question import Answer, negative, zero
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.smooth_pieces import pieces
from hsdsl.lint.analysis.wording import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import EdgePart, ModePart, Subject

_GRAZES = "runs can graze it"


def check(subject: Subject) -> Iterator[Finding]:
    """Find guards that can be touched."""
    dynamics = subject.dynamics
    found = Repeats("guard", "with this L_f r")
    for part in subject.modes:
        for edge in part.edges:
            residual = dynamics.residual(edge.edge.surface)
            rate = dynamics.rate(part.mode, residual)
            if rate is None or rate.is_number or found.again(rate):
                continue
            answer, how = _touched(subject, part, edge)
            if answer.somewhere:
                bend = dynamics.rate(part.mode, rate) if how == _GRAZES else None
                where = at(dynamics, part.mode, answer, [residual, rate, bend])
                message = f"the flow meets the guard of '{edge.edge.name}' {where}, where L_f r = 0: {how}"
                span = edge.document.when.place.span
                found.add(rate, Finding(span, message, None, answer.decided or "sampled"))
    yield from found


def _touched(subject: Subject, part: ModePart, edge: EdgePart) -> tuple[Answer, str]:
    """A point of the guard where the rate vanishes, and what the flow does there."""
    dynamics, mode = subject.dynamics, part.mode
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
        if answer.somewhere and _what(ModePoint(dynamics, mode, answer.point), residual) == _GRAZES:
            return answer, _GRAZES
    guard = dynamics.guard(edge.edge)
    answer = dynamics.ask_any(mode, guard, zero(dynamics.rate(mode, residual)))
    return answer, _what(ModePoint(dynamics, mode, answer.point), residual) if answer.somewhere else ""


def _what(here: ModePoint, residual: Any) -> str:
    """Say what the flow does at a point of a surface where the first derivative vanishes."""
    try:
        order, sign = here.first(residual)
    except Unsure:
        return "a kink, a jump or an input decides there whether it crosses"
    if not sign:
        return f"all derivatives of r along the flow vanish there, up to order {order}"
    if order % 2:
        return f"it {'goes out' if sign > 0 else 'comes in'} there, with the derivative of order {order} alone"
    return _GRAZES if sign < 0 else "runs come there only by resting on it, or by starting there"
