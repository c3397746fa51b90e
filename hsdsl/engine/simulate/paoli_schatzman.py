"""The Paoli-Schatzman scheme for one mass and one stop (Burden et al. 2013, Sec. V-B): two steps, positions only.

With x'' = f(t) - 2 a x' - k x, x <= x_max, restitution c and step h (L. Paoli and M. Schatzman, A numerical scheme for
impact problems I, SIAM J. Numer. Anal. 40, 2002, doi:10.1137/S0036142900378728):

    z_{n+1} = -c z_{n-1} + min(y_n, (1 + c) x_max)
    y_n = (h^2 f(t_n) + (2 - h^2 k) z_n - ((1 - c) - (1 + c) a h) z_{n-1}) / (1 + a h)

It locates nothing and makes no transitions. A step whose minimum is the stop's is *in contact*; consecutive ones are
recognised as one impact, at the first of them, also where a mass at rest stays on the stop. Velocities are quotients of
positions: central in flight, one-sided at an impact (a rebound takes two steps), the one ahead in contact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Stop
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.simulate.recorder import Counted
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.surfaces import Crossing


@dataclass(frozen=True)
class Path:
    """Positions ``z[n]`` at times n h, and ``contact[n]``: whether the stop decided ``z[n + 1]``."""

    h: Number
    z: list[Number]
    contact: list[bool]

    def slope(self, n: int) -> Number:
        """The quotient from step n to the next, or the last one there is."""
        n = min(n, len(self.z) - 2)
        return (self.z[n + 1] - self.z[n]) / self.h

    def impact(self, n: int) -> bool:
        """Whether contact begins with step n."""
        return self.contact[n] and not self.contact[n - 1]

    def velocity(self, n: int) -> Number:
        """Velocity at step n > 0; after the impact where one begins there."""
        if self.impact(n):
            return self.slope(n + 1) if self.contact[n + 1 : n + 2] == [True] else self.slope(n)
        return self.slope(n) if self.contact[n] else (self.z[n + 1] - self.z[n - 1]) / (2 * self.h)


def paoli_schatzman(run: Run, here: ModeState | Stop) -> Stop:
    """Follow the scheme from ``here`` to the end; ``run.settings.one_stop`` is the model's structure."""
    one_stop, h = run.settings.one_stop, run.settings.step
    if one_stop is None or h is None:
        raise ValueError("scheme paoli-schatzman needs a mechanical model with one stop, and a step")
    if isinstance(here, Stop):
        return here
    routines = routines_of(run, here)

    def outputs(t: Number, *x: Number) -> State:
        return routines(t).outputs(t, *x)

    here.arc.outputs = outputs
    room = run.recorder.room
    path = Path(h, Counted(room, here.x[one_stop.position]), [False])
    steps = int(run.settings.until / h)
    if (steps + 1) * h - run.settings.until <= run.tie(run.settings.until):
        steps += 1
    try:
        failed = step_through(run, here, path, routines, steps)
    finally:  # an interrupted run keeps what it has
        room.left += len(path.z)  # for the rows that are made of it
        ended = write(run, here, path, steps)
    return ended or failed or Stop("until", run.settings.until, f"reached t = {show(run.settings.until)}")


def routines_of(run: Run, here: ModeState) -> Callable[[Number], ModeKernel]:
    """Make the function that gives the mode's routines bound to the input segment of a time."""
    if len(run.timeline.segments) == 1:
        return lambda t: here.kernel
    mode = here.index
    bound: dict[Number, ModeKernel] = {}

    def routines(t: Number) -> ModeKernel:
        segment = run.timeline.at(t)
        if segment.start not in bound:
            bound[segment.start] = run.kernel.bind(mode, segment.data)
        return bound[segment.start]

    return routines


def step_through(
    run: Run, here: ModeState, path: Path, routines: Callable[[Number], ModeKernel], steps: int
) -> Stop | None:
    """Fill ``path`` up to the step after ``steps``; say why it ends before that, if it does."""
    o = run.settings.one_stop
    assert o is not None
    h, z, contact, isfinite = path.h, path.z, path.contact, run.arithmetic.isfinite
    still = (run.arithmetic.zero,) * 2
    c, level, v = o.restitution, (1 + o.restitution) * o.level, here.x[1 - o.position]
    ahead, back, both = 2 - h * h * o.stiffness, (1 - c) - (1 + c) * (o.damping * h), 1 + o.damping * h
    for n in range(steps + 1):
        t = n * h
        try:
            force = routines(t).flow(t, *still)[1 - o.position]
        except DOMAIN_ERRORS:
            return run.standstill(here).not_finite([(t, still)])
        if n == 0:
            z.append(z[0] + h * v + h * h / 2 * (force - 2 * o.damping * v - o.stiffness * z[0]))
        else:
            y = (h * h * force + ahead * z[n] - back * z[n - 1]) / both
            touching = y > level if o.above else y < level
            contact.append(touching)
            z.append((level if touching else y) - c * z[n - 1])
        if not isfinite(z[-1]):
            z.pop()
            return Stop("not_finite", t, f"the position grows beyond all numbers at t = {show(t)}: shorten the step")
    return None


def write(run: Run, here: ModeState, path: Path, steps: int) -> Stop | None:
    """Write the rows of a path, and the transitions recognised in it; stop at the limit of transitions."""
    one_stop, until = run.settings.one_stop, run.settings.until
    assert one_stop is not None
    arc, whole = here.arc, len(path.z) > steps + 1

    def state(x: Number, v: Number) -> State:
        return (x, v) if one_stop.position == 0 else (v, x)

    for n in range(1, min(len(path.z) - 1, len(path.contact))):
        t = n * path.h
        if n == steps and (t > until or until - t <= run.tie(until)):
            t = until
        if path.impact(n):
            if stop := run.limit_reached(t):
                return stop
            before, after = state(path.z[n], path.slope(n - 1)), state(path.z[n], path.velocity(n))
            arc.append(t, before, ())
            run.record(here, Crossing(0, t * 0, t, before, t * 0), t, after, ())
            arc = run.recorder.begin(arc.mode, arc.states, "flow", arc.outputs, t, after)
        else:
            arc.append(t, state(path.z[n], path.velocity(n)), ())
    if whole and arc.times[-1] < until:
        share = (until - arc.times[-1]) / path.h
        last, v = path.z[steps], path.slope(steps)
        arc.append(until, state(last + share * (path.z[steps + 1] - last), v), ())
    return None
