"""Errors of a run without another run: a shadow run takes the same steps, closer to the solution.

The shadow run starts where the run does. Each of its steps begins where it is itself, and takes as long as the run's.
It makes each transition where it crosses the same surface. Its distance to the run is the sum of what the run's steps
left out, carried along by the flow and by jumps, as long as that is small.

- What the polynomial of a Taylor step leaves out follows from how badly it solves the equation at the end, as when its
  size was chosen. The first two terms that are left out are found so: an even or odd solution is no trap.
- What such a step makes of the distance before is the difference of two series. The run has recorded one of them. The
  other has fewer terms: a distance needs few digits. Where its last two terms, times the number of steps, exceed all of
  a state's terms together, more are made from there on, up to as many as the run has. So growth that the run does not
  show is seen.
- Both follow for other methods from a correction of the step, as long as that leaves out less than the step.
- Round-off is much the same for both, so each step moves the shadow run further away from the run by the most that it
  may do: that of the flow, and of states that move. Where an arc begins these are rounded, too. Starts, parameters and
  results of resets are moved by their own round-off, and crossings by that of their surface: see `moving`.

The shadow run crosses no other surface: enclosures wider than the errors decide along the run's own steps that none
is reached.

**A correction.** The run is at p(s) at the share s of a step of length h, and the shadow run at p(0) + e where it
begins. A polynomial by Radau IIA is off inside by more than at its end, by two powers of h: so much that changes of the
derivatives along the step matter. It fails the flow by a multiple of M(s), the product of s - c over its nodes. So with
u, of what it fails where that is most, the shadow run is first taken to be at q(s) = p(s) + e + u m(s), m being the
integral of M, which is 0 at both ends. Then it is at q(s) + d(s), where, J being the derivatives of the flow by the
states at the step's end,

    d' = h J d + g,    g(s) = h f(t + s h, q(s)) - q'(s),    d(1) = integral of exp((1 - s) h J) g(s) over [0, 1].

That is one iteration of Newton's method from q, for polynomials of any method. Of g the values at the four nodes of
Radau's quadrature are taken, which is exact to degree 6: collocation by three of them leaves out no less. The
exponential of each power of s has a rational function instead, with one pole of order 6, so that one real matrix is
factored. Its series agree with the exact ones to the power 3 of h J, and with those at infinity to the power -2: so
small an error as that of a stiff state at the end of a step is found, of which defects elsewhere in the step are
thousands of times as large. The pole 1/5 makes the shadow run's own steps A-stable, and keeps the amplitude of an
oscillation of one radian a step to 1e-4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property
from math import comb, factorial, isfinite, sqrt
from typing import Any, NamedTuple

import numpy as np

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS
from hsdsl.base.numbers.bernstein import Array
from hsdsl.engine.execution import Arc, Execution, Transition
from hsdsl.engine.integrators import Method
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.integrators.taylor import terms
from hsdsl.engine.simulate.moving import flow_roundoff, moved_reset, surface_roundoff
from hsdsl.engine.simulate.problem import Problem, Tails
from hsdsl.engine.simulate.verdict.errors import Errors

MOST_ORDER = 30  # of series in C: HS_MOST_ORDER
MOST_CORRECTED = 5  # order of methods whose steps leave out more than corrections of them
MOST_CHANGES = 8  # of Newton's method
CLOSED_IN = 2.0**-10  # of the tie tolerance: a crossing's time is found
ROUNDED = 2.0**-52  # of a state that moves, in each step
FEWEST, MORE_TERMS = 3, 2  # the order of the first series, and by how much it grows where that is not enough
NODES, POWERS = 4, 6
POLE = 1 / 5
INSIDE = (6 - sqrt(6)) / 10  # where a polynomial by Radau IIA is compared with the flow: `collocation`


class ShadowErrors(NamedTuple):
    """How far a run is from its shadow run."""

    state_errors: Array  # (rows, states of the largest mode)
    time_errors: Array  # (transitions,): how far the times of transitions are apart, up to each
    lost: float | None = None  # from when on it could not follow


@dataclass(frozen=True)
class ErrorsByShadow(Errors):
    """What a shadow run shows of a run."""

    shadow: ShadowErrors = field(kw_only=True)

    @cached_property
    def parted(self) -> float | None:
        """From when on the shadow run could not follow."""
        return self.shadow.lost

    @cached_property
    def time_errors(self) -> Array:
        """How far times of transitions are apart, up to each of them; shape (transitions,)."""
        return self.shadow.time_errors

    @cached_property
    def measured(self) -> Array:
        """How far the run is from its shadow run in each state; shape (rows, states), nowhere falling."""
        found = np.zeros(self._values.shape)
        for arc in self.run.arcs:
            columns = [self.columns[name] for name in arc.states]
            found[arc.first : arc.last + 1, columns] = self.shadow.state_errors[
                arc.first : arc.last + 1, : len(columns)
            ]
        return np.maximum.accumulate(np.nan_to_num(found))


def is_compiled(run: Execution) -> bool:
    """Whether a run was made in C, where it is followed as well."""
    return run.compiled is not None


def order_of(method: Method) -> int | None:
    """The most that the order of the shadow run's series may be: with one coefficient more, as many as the run's.

    None where it has no series.
    """
    return method.order - 1 if method.is_series else None


def has_shadow(problem: Problem, run: Execution) -> bool:
    """Whether a shadow run shows the errors of a run: one with a tolerance, without strips and samples of inputs.

    Strips and transitions on entry of a run made in C are found where the shadow run follows it.
    """
    return (
        may_have_shadow(problem)
        and run.stop.complete
        and (is_compiled(run) or not (run.enters_beyond or any(arc.kind != "flow" for arc in run.arcs)))
    )


def may_have_shadow(problem: Problem) -> bool:
    """Whether a shadow run may show the errors of runs of a problem."""
    settings, method = problem.settings, problem.settings.method
    return (
        settings.scheme == "located"
        and settings.tolerance is not None
        and method is not None
        and method.order <= (MOST_ORDER if method.is_series else MOST_CORRECTED)
        and problem.arithmetic.digits is None
        and len(problem.timeline.segments) == 1
    )


def shadow_errors(problem: Problem, run: Execution) -> ShadowErrors:
    """Follow a run that has a shadow run."""
    assert problem.settings.method is not None
    shadow, arcs = ShadowRun(problem, run, order_of(problem.settings.method)), run.arcs
    lost = None
    for arc, following in zip(arcs, (*arcs[1:], None), strict=True):
        if problem.program.modes[shadow.modes[arc.mode]].final:
            break
        leaves = arc.jump < len(run.transitions) and (following is None or following.jump > arc.jump)
        try:
            shadow.follow(arc, run.transitions[arc.jump] if leaves else None)
        except (Lost, *DOMAIN_ERRORS):
            lost = float(run.times[arc.first])
            break
    late = np.maximum.accumulate([float(problem.tie(run.times[-1])), *shadow.time_errors])[1:]
    missing = np.full(len(run.transitions) - len(late), np.inf)
    return ShadowErrors(shadow.state_errors, np.append(late, missing), lost)


class Lost(ValueError):
    """The shadow run cannot follow."""


class ShadowRun:
    """The shadow run on its way: its time and state; ``order`` is the most that its series have, None for no series."""

    def __init__(self, problem: Problem, run: Execution, order: int | None) -> None:
        self.problem, self.run, self.most = problem, run, order
        self.order: int = min(FEWEST, order or 0)
        self.modes = {mode.name: k for k, mode in enumerate(problem.program.modes)}
        self.state_errors = np.zeros((len(run.times), run.values.shape[1]))
        self.times: list[float] = run.times.tolist()
        self.time_errors: list[float] = []
        self.t: float = float(run.times[0])
        self.x: State = problem.start.x
        self.data, self.moved = problem.timeline.segments[0].data, problem.start.data
        self.tails = Tails(problem.waits)

    def follow(self, arc: Arc, made: Transition | None) -> None:
        """Follow one arc, and the transition that ends it."""
        times, mode = self.times, self.modes[arc.mode]
        shift = self.t - times[arc.first]
        for row in range(arc.first, arc.last + 1):
            h = times[row] - times[row - 1] if row > arc.first else 0.0
            if h > 0:
                self.x, self.t = self._end(mode, row - 1, h, row == arc.first + 1), times[row] + shift
            self._compare(row, self.run.values[row], self.x)
        if made:
            self._jump(arc, made)

    def _end(self, mode: int, row: int, h: float, begins: bool) -> State:
        """Where the run's step from a row takes it; where an arc begins, its states are rounded."""
        x, end = np.asarray(self.run.values[row : row + 2, : len(self.x)], dtype=float)
        piece = np.asarray(self.run.coefficients[row][:, : len(self.x)], dtype=float)
        kernel, t1 = self.problem.kernel, self.times[row + 1]
        slope = np.array(kernel.bind(mode, self.data).flow(t1, *end.tolist()))
        off = flow_roundoff(kernel, mode, self.data, t1, tuple(end.tolist()))
        if off is None:
            raise Lost
        noise = np.array(off)
        moves = slope != 0
        noise += np.where(moves, ROUNDED * np.abs(end) / h, 0.0)
        if begins:
            away = np.array(self.x) - x
            self.x = tuple((x + away + np.copysign(np.where(moves, ROUNDED * np.abs(x), 0.0), away)).tolist())
        if self.most is None:
            away = np.array(self.x) - x
            inside, further = self._corrected(mode, x, piece, h, end, np.copysign(h * noise, away))
            self._compare(row + 1, x, tuple((x + away + inside).tolist()))
            return tuple((end + (away + further)).tolist())
        away = self._away(mode, x, piece, h).sum(axis=0)
        away += self._left_out(mode, t1, end, piece, h, slope)
        return tuple((end + away + np.copysign(h * noise, away)).tolist())

    def _corrected(self, mode: int, x: Array, piece: Array, h: float, end: Array, moved: Array) -> tuple[Array, Array]:
        """How much further away a step takes it, inside and at the end; what is moved goes on as the flow does."""
        flow, jacobian = self.problem.kernel.bind(mode, self.moved).flow, self.problem.kernel.jacobian(mode, self.moved)
        slopes = np.array(jacobian(self.t + h, *end.tolist()), dtype=float).reshape(len(end), len(end))

        def defect(s: float, away: Array, rate: Array) -> Array:
            powers = np.arange(1, len(piece) + 1)
            at = x + s**powers @ piece + away
            slope = powers * s ** (powers - 1) @ piece + rate
            return h * np.array(flow(self.t + s * h, *at.tolist())) - slope + moved

        return corrected(defect, np.array(self.x) - x, h * slopes)

    def _away(self, mode: int, x: Array, piece: Array, h: float) -> Array:
        """How far its terms are from the run's, so many that all steps together leave out little of it."""
        series = self.problem.kernel.taylor(mode, self.moved)
        if series is None:
            raise Lost
        while True:
            made = terms(series, self.order, self.t, self.x)
            stages = np.array(made, dtype=float).reshape(self.order + 1, len(self.x))
            powers = np.cumprod(np.full(len(stages), h))  # as the run in C does
            away = np.vstack([np.array(self.x) - x, stages * powers[:, None] - piece[: len(stages)]])
            sizes = np.abs(away)
            settled = np.all(len(self.times) * sizes[-2:].sum(axis=0) <= sizes.sum(axis=0))
            if settled or self.most is None or self.order == self.most:
                return away
            self.order = min(self.order + MORE_TERMS, self.most)

    def _left_out(self, mode: int, t: float, x: Array, piece: Array, h: float, slope: Array) -> Array:
        """What the run's polynomial X leaves out by the end of its step, where the flow is ``slope``.

        With d = X' - f(X) at the end and J the derivatives of f, e' = J e - d for what is left out, e: it is close to
        -h d/order, and what follows from J e is close to h (J e)/(order + 1).
        """
        order = len(piece) + 1
        e = (h * slope - np.arange(1, order) @ piece) / order
        flow = self.problem.kernel.bind(mode, self.data).flow(t, *(x + e).tolist())
        return e + h * (np.array(flow) - slope) / (order + 1)

    def _compare(self, row: int, x: Any, y: State) -> None:
        if not all(map(isfinite, y)):
            raise Lost
        away = np.abs(np.asarray(x[: len(y)], dtype=float) - y)
        self.state_errors[row, : len(y)] = np.fmax(self.state_errors[row, : len(y)], away)

    def _jump(self, arc: Arc, made: Transition) -> None:
        """Make a transition where it crosses the surface but for its round-off, on a straight line from where it is."""
        mode, y = self.problem.program.modes[self.modes[arc.mode]], self.x
        index = self.modes[arc.mode]
        kernel = self.problem.kernel.bind(index, self.moved)
        found = [k for k, edge in enumerate(mode.edges) if edge.name == made.edge]
        k = min(found, key=lambda k: abs(kernel.surfaces(made.time, *made.before.values())[k]))
        tie, change, s = float(self.problem.tie(max(self.t, self.times[-1]))), np.inf, 0.0
        slope, beyond = kernel.flow(self.t, *y), surface_roundoff(self.problem.kernel, index, k, self.moved, self.t, y)
        for _ in range(MOST_CHANGES):
            value, rate = kernel.surfaces(self.t + s, *y)[k], kernel.rates[k](self.t + s, *y)[0]
            if not rate > 0:
                raise Lost
            change = (value + beyond) / rate
            s -= change
            y = tuple(a + s * b for a, b in zip(self.x, slope, strict=True))
            if abs(change) <= CLOSED_IN * tie:
                break
        if not abs(change) <= tie:
            raise Lost
        self._compare(arc.last, list(made.before.values()), y)
        self.t += s
        self.time_errors.append(abs(float(made.time) - self.t))
        after = moved_reset(self.problem.kernel, index, k, self.moved, self.t, y) or ()
        if not after and mode.edges[k].target_states:
            raise Lost
        self.x = self.tails.advance(mode, y, self.problem.program.modes[mode.edges[k].target], after)


def corrected(defect: Callable[[float, Array, Array], Array], apart: Array, slopes: Array) -> tuple[Array, Array]:
    """Return how far p is off inside, and d(1); ``apart`` and ``slopes`` are e and h J.

    ``defect(s, away, rate)`` is how badly p, moved by ``away`` and its slope by ``rate``, solves the equation at s.
    """
    (nodes, weights, bulge, rates), w = correction(), np.linalg.inv(np.eye(len(slopes)) - POLE * slopes)
    zero = np.zeros(len(apart))
    u = w @ defect(INSIDE, zero, zero)
    places = zip(nodes.tolist(), bulge, rates, strict=True)
    g = np.array([defect(s, apart + u * m, u * rate) for s, m, rate in places])
    end = np.zeros(len(slopes))
    for each in weights[::-1]:
        end = w @ (each @ g + end)
    return POLE * u, end


@cache
def correction() -> tuple[Array, Array, Array, Array]:
    """The coefficients of a correction: four nodes, weights (6, 4), and m and M at the nodes.

    d(1) is the sum of W**(m + 1) times the sum of ``weights[m, i]`` g at node i, W the inverse of 1 - h J/5. M is 1
    where the polynomial is compared with the flow.
    """
    from numpy.polynomial import Legendre, Polynomial  # few runs need them

    roots: list[float] = Legendre([*np.zeros(NODES - 1), -1.0, 1.0]).roots().real.tolist()
    nodes = np.array([*((1 + root) / 2 for root in sorted(roots)[:-1]), 1.0])
    to_powers = np.linalg.inv(np.vander(nodes, increasing=True))
    weights = np.column_stack([_of_power(k) for k in range(NODES)]) @ to_powers
    fails = Polynomial.fromroots([(4 - sqrt(6)) / 10, (4 + sqrt(6)) / 10, 1])
    fails /= fails(INSIDE)
    return nodes, weights, fails.integ()(nodes), fails(nodes)


def _of_power(k: int) -> Array:
    """Weights of W, W**2, ... in the integral of exp((1 - s) z) s**k, where W = 1/(1 - z/5).

    At infinity W is -5/z - 25/z**2 - ..., and the integral -1/z - k/z**2 - .... The coefficient of z**i is
    C(m + i, i)/5**i in W**(m + 1), and k!/(k + i + 1)! in the integral.
    """
    first = [POLE, POLE - k * POLE**2]
    powers = range(POWERS - len(first))
    terms = np.array([[comb(m + i, i) * POLE**i for m in range(POWERS)] for i in powers])
    right = [factorial(k) / factorial(k + i + 1) for i in powers] - terms[:, :2] @ first
    return np.array([*first, *np.linalg.solve(terms[:, 2:], right)])
