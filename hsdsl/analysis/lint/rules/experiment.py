"""Rules about the experiment: where a run starts and ends, and its relaxation."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from hsdsl.analysis.lint.finding import Finding
from hsdsl.analysis.lint.subject import BEYOND, ON, ModePart, Number, Subject, evaluate, holds, leaves, side
from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.language.expression import numeric
from hsdsl.language.expression.scope import symbol
from hsdsl.language.source import Scalar
from hsdsl.language.system import TIME, Mode, Surface
from hsdsl.mathematics.decisions.mode_point import ModePoint, Unsure, ranked

_SMALLER = "choose a smaller relaxation"
_TIE_OF_WRITTEN_TIMES = 1e-9


def starts_outside(subject: Subject) -> Iterator[Finding]:
    """Find initial states beyond a guard or a wall."""
    part = subject.mode(subject.system.initial.mode)
    place, hint = subject.document.initial.mode.place, "start inside, or reverse the inequality"
    if part.mode.final:
        return
    edges = [edge for edge in part.mode.edges if edge.condition is None and side(edge.surface, subject.start) == BEYOND]
    first = f"'{ranked(edges)[0].name}' fires at once" if edges else ""
    for wall in part.mode.walls:
        if side(wall, subject.start) == BEYOND:
            yield Finding(
                place.span, f"the run starts beyond the wall `{wall.text}` and {first or 'stops at once'}", hint
            )
    for edge in edges:
        yield Finding(place.span, f"the run starts beyond the guard `{edge.surface.text}`, so {first}", hint)


def starts_on_guard(subject: Subject) -> Iterator[Finding]:
    """Find starts on a guard or a wall with outward flow."""
    part, start = subject.mode(subject.system.initial.mode), subject.start
    place = subject.document.initial.mode.place
    beyond = (e for e in part.mode.edges if e.condition is None and side(e.surface, start) == BEYOND)
    if part.mode.final or any(beyond):
        return  # the run ends, or another transition fires at once
    for edge in ranked(part.mode.edges):
        if holds(edge.condition, start) and _leaves_at_start(subject, part.mode, edge.surface):
            message = f"the run starts on the guard of '{edge.name}' with the flow pointing out, so it fires at once"
            yield Finding(place.span, message, "start inside, or with the flow pointing in")
            return
    for wall in part.mode.walls:
        if _leaves_at_start(subject, part.mode, wall):
            message = f"the run starts on the wall `{wall.text}` with the flow pointing out, and stops at once"
            yield Finding(place.span, message, "start inside")


def _leaves_at_start(subject: Subject, mode: Mode, surface: Surface) -> bool:
    """Whether the run starts on a surface, where surface and flow are smooth, and the flow points out."""
    if side(surface, subject.start) != ON or not leaves(mode, surface, subject.start):
        return False
    dynamics = subject.dynamics
    try:
        ModePoint(dynamics, mode, dynamics.starting_point).piece(dynamics.residual(surface), dynamics.flow(mode))
    except Unsure:
        return False
    return True


def ends_on_event(subject: Subject) -> Iterator[Finding]:
    """Find ends of the run at which a transition fires."""
    until = subject.setting("until")
    names = (*_guards_of_time(subject, until), *_reached_by_constant_flow(subject, until), *_recorded(subject, until))
    for name in dict.fromkeys(names):
        message = f"the run ends at the instant of '{name}'"
        yield Finding(subject.document.experiment.until.place.span, message, "end a little earlier or later")


def _guards_of_time(subject: Subject, until: Number) -> Iterator[str]:
    point = {**subject.numbers, TIME: until}
    for part, item in subject.edges:
        surface = item.edge.surface
        symbols = surface.residual.free_symbols
        reached = TIME in symbols and symbols <= set(point) and side(surface, point) == ON
        if reached and leaves(part.mode, surface, point) is not False:  # rising, as far as is known
            yield item.edge.name


def _reached_by_constant_flow(subject: Subject, until: Number) -> Iterator[str]:
    """The guards that the constant flow of the initial mode reaches at the end, and none before."""
    part = subject.mode(subject.system.initial.mode)
    end = {**subject.start, TIME: until}
    constant = set(subject.numbers)
    for state, rate in part.mode.vector_field.items():
        if not rate.free_symbols <= constant:
            return
        end[state] = evaluate(state + rate * TIME, {**subject.start, TIME: until})
    surfaces = [edge.surface for edge in part.mode.edges]
    sides = [side(surface, end) for surface in (*surfaces, *part.mode.walls) if _affine(part, surface.residual)]
    known = len(sides) == len(surfaces) + len(part.mode.walls)
    if known and all(where is not None and where <= ON for where in sides):
        pairs = zip(part.mode.edges, sides, strict=False)
        yield from (edge.name for edge, where in pairs if where == ON and holds(edge.condition, end))


def _affine(part: ModePart, residual: Any) -> bool:
    """Whether a surface function is affine in states and time: then it is monotone along a constant flow."""
    symbols = residual.free_symbols & {*map(symbol, part.mode.states), TIME}
    return all(residual.diff(a, b) == 0 for a in symbols for b in symbols)


def _recorded(subject: Subject, until: Number) -> Iterator[str]:
    """The transitions at the end that a reference of the file's own settings has."""
    for reference in subject.document.reference:
        for event in () if reference.settings else reference.transitions:
            time = subject.read(event if isinstance(event, Scalar) else event.time)
            if numeric.finite(time) and abs(time - until) <= TIE * abs(until):
                edge = None if isinstance(event, Scalar) else event.edge
                yield "a transition of the reference" if edge is None else edge.value


def large_relaxation(subject: Subject) -> Iterator[Finding]:
    """Find relaxations that are not below the step, a tenth of the run, or a time between transitions."""
    experiment = subject.document.experiment
    if not subject.relaxed or not any(mode.edges for mode in subject.system.modes):
        return
    place, relaxation = (experiment.relaxation or experiment.until).place, subject.relaxation
    gaps: list[Number] = []
    step, until = subject.setting("step"), subject.setting("until")
    for reference in subject.document.reference:
        written = (event if isinstance(event, Scalar) else event.time for event in reference.transitions)
        times = [time for time in map(subject.read, written) if numeric.finite(time)]
        ties = (_TIE_OF_WRITTEN_TIMES * max(until or 0, abs(time)) for time in times[1:])
        gaps += [
            after - before for (before, after), tie in zip(pairwise(times), ties, strict=True) if after - before > tie
        ]
    dwell = min(gaps, default=None)
    if step is not None and relaxation >= step:
        yield Finding(place.span, "the relaxation is not smaller than the step", _SMALLER)
    if numeric.finite(until) and until > 0 and relaxation * 10 >= until:
        yield Finding(place.span, "the relaxation is more than a tenth of the run", _SMALLER)
    if dwell is not None and relaxation >= dwell:
        between = f"{float(dwell):.3g}, a time between two transitions of the reference"
        yield Finding(place.span, f"the relaxation is not smaller than {between}", _SMALLER)
