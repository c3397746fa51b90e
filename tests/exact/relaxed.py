"""Relaxed executions in closed form (Fig. 10): exactly a time of epsilon in a strip at each transition."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from references.closed_form import ClosedForm, as_execution
from references.impact_oscillator import Flight, Motion
from references.interpolation import Stretch, mp
from references.rests import rest

from hsdsl.engine.execution import Arc, Verdict


def delayed(run: Any, eps: float) -> Any:
    """The relaxed execution of a system that does not depend on time: what follows each transition is eps later."""
    rows: list[int] = []
    times: list[Any] = []
    depth: list[float] = []
    arcs: list[Arc] = []
    for k, arc in enumerate(run.arcs):
        jumps = arc.jump
        if k and arc.jump > run.arcs[k - 1].jump:
            before, end = run.arcs[k - 1], times[-1]
            arcs.append(replace(before, kind="strip", jump=before.jump, first=len(rows), last=len(rows) + 1))
            rows += [before.last] * 2
            times += [end, run.times[arc.first] + jumps * eps]
            depth += [0.0, eps]
        arcs.append(replace(arc, first=len(rows), last=len(rows) + arc.last - arc.first))
        rows += range(arc.first, arc.last + 1)
        times += (run.times[arc.first : arc.last + 1] + jumps * eps).tolist()
        depth += [0.0] * (arc.last - arc.first + 1)
    transitions = tuple(
        replace(t, time=t.time + t.index * eps, resumed=t.time + (t.index + 1) * eps) for t in run.transitions
    )
    columns = {name: getattr(run, name)[rows] for name in ("values", "outputs", "coefficients")}
    return replace(
        run, times=np.array(times), depth=np.array(depth), arcs=tuple(arcs), transitions=transitions, **columns
    )


def relaxed_oscillator(motion: Motion, eps: float, until: float, of: Any) -> Any:
    """The relaxed execution of an oscillator with a stop up to a time: the force goes on while the mass waits.

    At rest on the stop it makes a transition each eps and leaves at the first that ends with the force pulling away:
    the rest up to there is one arc, since on the quotient space a strip's point is the state that waits.
    """
    stop, c, wait = motion.oscillator.number("x_max"), motion.oscillator.number("c"), mp.mpf(eps)
    stretches: list[Stretch] = []
    t, x, v = mp.zero, *motion.exactly(0)
    if motion.pieces[0][1] is None:
        released = mp.ceil(motion.released[0] / wait) * wait
        stretches.append(rest("free", t, released, (x, v)))
        t = released
    while t < until:
        flight = Flight.of(motion.oscillator, t, x, v)
        hit = motion._hit(flight)
        end = min(hit, mp.mpf(until))
        last = (stop, flight.at(end)[1]) if hit <= until else flight.at(end)
        edge = "impact" if hit <= until else None
        stretches.append(Stretch("free", t, end, (x, v), last, flight.at, flight.derivative, edge))
        t, x, v = hit + wait, stop, -c * last[1]
    form = ClosedForm("oscillator.yaml", "relaxed", "closed form", {"free": ("x", "v")}, stretches, UNKNOWN, 8)
    return replace(as_execution(form), digest=of.program.digest)


UNKNOWN = Verdict("unknown", ())
