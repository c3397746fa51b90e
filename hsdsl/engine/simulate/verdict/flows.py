"""The flow along steps: does it vary where no step evaluated it, jump, or have no bound on its slope?

A step's polynomial knows the flow at a few points. Operations of the flow that are not as smooth as half a step is long
may be pulses that it did not see. What they may add is compared with the error, on parts of the step that are halved;
there the flow is compared with the polynomial's own derivative, too.

For that, routines are expanded along parts of steps, many at once: what a formula is there up to third order. An
expansion is a function of u from -1 to 1, no further than its remainder from a polynomial. An operation is *resolved*
where what it makes beyond third order is no more than an eighth of its terms: its result is as smooth as the part is
long. What the others may add is carried along as unresolved. So a narrow pulse is unresolved, however small it is
against the terms that it is added to, and a term that varies with the part is not, however large.

Each function has its series around the middle of a part, with a bound of what follows; the others are made of these.
``runtime/c/expansions.c`` does the same, but for functions that it leaves open.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.base.numbers.arithmetic import NOTHING, Arithmetic, repeated
from hsdsl.base.numbers.bernstein import Array, around_middle
from hsdsl.base.numbers.enclosures import CONTINUOUS, ENCLOSED, Range, as_range, square
from hsdsl.engine.simulate.moving import ERROR_UNITS
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.errors import SAFE
from hsdsl.engine.simulate.verdict.run_view import MOST_PARTS, Finding, RunView
from hsdsl.engine.simulate.verdict.steps import Parts, high, joined, low, steps_of, undecided

HALVINGS = 14
SEEN = 0.5  # of a step: every method has stages on parts of such a width, and shows what is as smooth as they are long
PLACES = 64  # of a run where the round-off of its flow is bounded
ROUNDOFF_ROUNDS = 3  # from a flow's round-off to what that moves, and what that moves in turn


def flows(run: RunView) -> tuple[list[Finding], list[str]]:
    """Findings about the flow of every mode along all steps in it."""
    found = list(_jumps(run)) if run.undecided("flow change") else []
    if run.errors is None:
        return found, []
    for steps in steps_of(run, marked="changing"):
        with np.errstate(all="ignore"):
            steep = run.problem.program.modes[steps.mode].steep
            unbounded = [*_named(run, "the slope of the flow", "has no bound", _steep(run, steps))] if steep else []
            found += unbounded or _named(run, "a change of the flow", "may not have been seen", _unseen(run, steps))
    return found, []


def _jumps(run: RunView) -> Iterator[Finding]:
    """Modes whose flow may jump where the run was in them."""
    modes, visited = run.problem.program.modes, {arc.mode for arc in run.flows}
    jumping = {k: mode.name for k, mode in enumerate(modes) if mode.jumps and mode.name in visited}
    if jumping and run.errors is not None:
        with np.errstate(all="ignore"):
            meets = {steps.mode for steps in steps_of(run) if steps.mode in jumping and len(_meeting(run, steps))}
        jumping = {k: jumping[k] for k in meets}
    if jumping:
        where = f"the flow of mode {', '.join(jumping.values())} jumps where sign, floor or select does"
        yield Finding("jump", "unknown", f"{where}, or atan2 on its cut; the theorem assumes continuous flows")


def _meeting(run: RunView, steps: Parts) -> Parts:
    """Parts of steps on which the flow may jump within the error."""

    def decides(parts: Parts) -> NDArray[np.bool_]:
        kernel = run.problem.kernel.over(CONTINUOUS).bind(parts.mode, parts.bound_data)
        jumps = np.zeros((len(parts), 1), dtype=bool)
        for f in kernel.flow(parts.times, *parts.states(SAFE)):
            jumps[:, 0] |= ~np.isfinite(high(f, len(parts)) - low(f, len(parts)))
        return jumps

    return undecided(steps, decides, HALVINGS)[0]


def _named(run: RunView, what: str, how: str, parts: Parts) -> Iterator[Finding]:
    if len(parts):
        first = float((parts.time + parts.start * parts.length).min())
        name = run.problem.program.modes[parts.mode].name
        yield Finding("flow", "unknown", f"{what} of mode {name} {how} close to t = {show(first)}")


def _unseen(run: RunView, steps: Parts) -> Parts:
    """Parts of steps on which the flow may be what the step's polynomial does not show.

    Parts are halved where they may move a state by more than half of their share of what is allowed for the step, as
    long as all parts together may move it by more than that.
    """
    number = np.zeros(int(steps.row.max(initial=0)) + 1, dtype=int)
    number[steps.row] = np.arange(len(steps))
    allowance, parts, halvings = RESOLVED * np.maximum(steps.error, NOTHING), steps, 0
    decided, moved = steps.take([]), np.zeros((3, 0, steps.error.shape[1]))
    while True:
        step, here = number[parts.row], _moved_unseen(run, parts)
        open_ = np.logical_not(here[0] <= allowance[step] * parts.width[:, None] / 2)
        left: NDArray[np.bool_] = np.any(open_, axis=1)
        both, together = joined([decided, parts]), np.concatenate([moved, here], axis=1)
        far = _furthest(number[both.row], both.start, together, allowance)
        left &= np.any(np.logical_not(far <= allowance), axis=1)[step]
        if halvings == HALVINGS or not 0 < left.sum() <= MOST_PARTS // 2:
            return parts.take(left)
        kept = np.concatenate([np.ones(len(decided), dtype=bool), ~left])
        decided, moved = both.take(kept), together[:, kept]
        parts, halvings = parts.take(left).halves(), halvings + 1


def _furthest(step: NDArray[np.int64], start: Array, moved: Array, allowance: Array) -> Array:
    """How far parts, one after another, may move states along their steps; shape (steps, n)."""
    order = np.lexsort((start, step))
    steps, first, counts = np.unique(step[order], return_index=True, return_counts=True)
    most, drift, unresolved = moved[:, order]
    drift = np.clip(
        drift, -3 * allowance[step[order]], 3 * allowance[step[order]]
    )  # no step spoils the sums of another
    sums = np.cumsum(drift, axis=0)
    since = np.abs(sums - np.repeat(sums[first] - drift[first], counts, axis=0))
    found = np.zeros(allowance.shape)
    found[steps] = (
        np.maximum.reduceat(since, first) + np.maximum.reduceat(most, first) + np.add.reduceat(unresolved, first)
    )
    return found


def _moved_unseen(run: RunView, parts: Parts) -> Array:
    """How far states are moved along parts by what these do not show; shape (3, N, n).

    Either way, in all, and by what may have any sign: that is what is unresolved or, on parts so short that not
    each has a stage, how the flow differs from the slopes of the states' polynomials. What errors of states change
    the flow by is no pulse.
    """
    (time, *states), slopes = _expanded(parts)
    data = [line(column, 0.0) for column in parts.data.T]
    flow = run.problem.kernel.over(EXPANDED).bind(parts.mode, data).flow(time, *states)
    found = np.zeros((3, len(parts), len(slopes)))
    for i, (f, slope) in enumerate(zip(flow, slopes, strict=True)):
        differs, allowed = f - slope, RESOLVED * f.error
        shown, drift = (np.where(parts.width < SEEN, a, 0.0) for a in (differs.magnitude, differs.mean))
        found[0, :, i] = np.maximum(f.unresolved + shown - allowed, 0.0)
        found[1, :, i] = np.copysign(np.maximum(np.abs(drift) - allowed, 0.0), drift)
        found[2, :, i] = np.maximum(f.unresolved - np.maximum(allowed - np.abs(drift), 0.0), 0.0)
    return found * (parts.width * parts.length)[:, None]


def _expanded(parts: Parts) -> tuple[list[Expansion], list[Expansion]]:
    """Time and states along each part, and the derivatives of these."""
    degree = parts.bernstein.shape[2] - 1
    powers: Array = parts.bernstein @ around_middle(degree)
    half = parts.width * parts.length / 2
    slopes = powers[..., 1:] * np.arange(1.0, degree + 1) / half[:, None, None]
    times = line(parts.time + (parts.start + parts.width / 2) * parts.length, half)
    states = [polynomial(powers[:, i], error) for i, error in enumerate(parts.error.T)]
    return [times, *states], [polynomial(slope, np.zeros(len(parts))) for slope in slopes.swapaxes(0, 1)]


def _steep(run: RunView, steps: Parts) -> Parts:
    """Parts of steps on which a derivative of the flow may have no bound."""

    def decides(parts: Parts) -> NDArray[np.bool_]:
        data = parts.bound_data
        slopes = run.problem.kernel.enclosing.jacobian(parts.mode, data)(parts.times, *parts.states())
        unbounded = np.zeros((len(parts), 1), dtype=bool)
        for slope in slopes:
            unbounded[:, 0] |= ~(np.isfinite(high(slope, len(parts))) & np.isfinite(low(slope, len(parts))))
        return unbounded

    return undecided(steps, decides, HALVINGS)[0]


def reliability(run: RunView) -> Iterator[Finding]:
    """From when on the run and its finer repetition differ in more than digits; sets ``run.reliable_until``."""
    if unreliable := _unreliable(run):
        run.reliable_until, why = unreliable
        yield Finding("reliability", "unknown", f"the run is unreliable from t = {show(run.reliable_until)} on: {why}")


def _unreliable(run: RunView) -> tuple[float, str] | None:
    """From when on the run is unreliable, and why; None where it is not.

    Round-off of the flow excuses an error only where no transition follows from it.
    """
    if run.errors is None or run.screen is not None:
        return None  # there is a screen only where both runs agree
    found: list[tuple[float, str]] = []
    if run.errors.parted is not None:
        found.append((run.errors.parted, "from there a finer run makes other transitions"))
    grown, columns = run.errors.unreliable, run.errors.columns
    floor = _roundoff(run) if grown and not found else {}
    for name, time in grown.items():
        if run.errors.by_row[-1, columns[name]] > SAFE * floor.get(name, 0.0):
            found.append((time, f"the error of {name} exceeds a tenth of its size"))
    return min(found, default=None)


def _roundoff(run: RunView) -> dict[str, float]:
    """What round-off in the flow alone may move each state by over the run.

    A state that stays near zero by cancellation has no digit right, and nothing is wrong with it.
    """
    span, unit = float(run.times[-1] - run.times[0]), ERROR_UNITS * float(run.arithmetic.unit)
    ends = list(steps_of(run, PLACES))
    moved: dict[str, float] = {}
    for _ in range(ROUNDOFF_ROUNDS):
        found = dict(moved)
        for steps in ends:
            names = run.problem.program.modes[steps.mode].states
            t, *x = steps.ends()[0]
            sizes = [np.abs(t.low), *(np.abs(a.low) for a in x)]
            wide = [unit * size + moved.get(name, 0.0) for name, size in zip(("", *names), sizes, strict=True)]
            box = [Range(a.low - e, a.high + e) for a, e in zip((t, *x), wide, strict=True)]
            for name, f in zip(names, map(as_range, steps.bound(run).flow(*box)), strict=True):
                found[name] = max(found.get(name, 0.0), span * float(np.max(f.high - f.low)))
        moved = found
    return moved


ORDER = 3
EXPANSION_ROUNDOFF = 2.0**-48  # of all terms together: more than rounding makes of a coefficient
RESOLVED = 8  # terms are so many times what is beyond them; what moves a state by so many errors is seen


@dataclass(frozen=True, eq=False)
class Expansion:
    """Functions along N parts, element by element."""

    terms: Array  # (4, N): coefficients of 1, u, u**2 and u**3
    remainder: Array  # how far the function may be from these; infinite where nothing is known
    unresolved: Array  # how much of that no smooth function explains
    error: Array  # how much the errors of states change it, where no terms cancel

    @property
    def variation(self) -> Array:
        """How far the polynomial may be from its value in the middle."""
        return np.abs(self.terms[1:]).sum(axis=0)

    @property
    def magnitude(self) -> Array:
        """How far the polynomial may be from zero."""
        return np.abs(self.terms).sum(axis=0)

    @property
    def mean(self) -> Array:
        """The mean of the polynomial."""
        return self.terms[0] + self.terms[2] / 3

    @property
    def deviation(self) -> Array:
        """How far the function may be from that."""
        return self.variation + self.remainder

    @property
    def size(self) -> Array:
        """How far it may be from zero."""
        return self.magnitude + self.remainder

    @property
    def range(self) -> Range:
        """All that it may be."""
        return Range(self.terms[0] - self.deviation, self.terms[0] + self.deviation)

    def __neg__(self) -> Expansion:
        return Expansion(-self.terms, self.remainder, self.unresolved, self.error)

    def __add__(self, other: Expansion) -> Expansion:
        remainder = self.remainder + other.remainder + (self.size + other.size) * EXPANSION_ROUNDOFF
        return _known(self.terms + other.terms, remainder, self.unresolved + other.unresolved, self.error + other.error)

    def __sub__(self, other: Expansion) -> Expansion:
        return self + -other

    def __mul__(self, other: Expansion) -> Expansion:
        if other is self:
            return at_most(product(self, self), square, self)
        return at_most(product(self, other), Range.__mul__, self, other)

    def __truediv__(self, other: Expansion) -> Expansion:
        return at_most(product(self, reciprocal(other)), Range.__truediv__, self, other)


def line(value: Any, slope: Any) -> Expansion:
    """A linear function, known up to rounding."""
    value, slope = np.broadcast_arrays(np.atleast_1d(np.asarray(value, dtype=float)), slope)
    zero = np.zeros(value.shape)
    return Expansion(np.stack([value, slope, zero, zero]), np.abs(value) * EXPANSION_ROUNDOFF, zero, zero)


def polynomial(powers: Array, error: Array) -> Expansion:
    """A polynomial of u; ``powers`` has shape (N, degree + 1)."""
    sizes = np.abs(powers)
    terms = np.zeros((ORDER + 1, len(powers)))
    terms[: powers.shape[1]] = powers[:, : ORDER + 1].T
    remainder = sizes[:, ORDER + 1 :].sum(axis=1) + sizes[:, : ORDER + 1].sum(axis=1) * EXPANSION_ROUNDOFF
    return Expansion(terms, remainder, np.zeros(len(powers)), error)


def _known(terms: Array, remainder: Array, unresolved: Array, error: Array) -> Expansion:
    """An expansion, or one of which nothing is known."""
    lost = ~np.isfinite(remainder)
    if lost.any():
        terms, error = np.where(lost, 0.0, terms), np.where(lost, 0.0, error)
        remainder, unresolved = np.where(lost, np.inf, remainder), np.where(lost, np.inf, unresolved)
    return Expansion(terms, remainder, unresolved, error)


def _flat(value: Range, error: Any = 0.0) -> Expansion:
    """A constant, and anything within a range."""
    half = (value.high - value.low) / 2
    terms = np.zeros((ORDER + 1, *np.shape(half)))
    terms[0] = value.low + half
    return _known(terms, half + np.abs(terms[0]) * EXPANSION_ROUNDOFF, half, error + np.zeros(half.shape))


def chosen(which: Any, one: Expansion, other: Expansion) -> Expansion:
    """One of two, element by element."""
    return Expansion(
        np.where(which, one.terms, other.terms),
        np.where(which, one.remainder, other.remainder),
        np.where(which, one.unresolved, other.unresolved),
        np.where(which, one.error, other.error),
    )


def at_most(found: Expansion, function: Callable[..., Any], *arguments: Expansion) -> Expansion:
    """The constant instead, where less is unresolved in all that a function may be."""
    if not (found.unresolved > 0).any():
        return found
    flat = _flat(as_range(function(*(a.range for a in arguments))), found.error)
    better = reduce(np.logical_and, [np.isfinite(a.remainder) for a in arguments], flat.unresolved < found.unresolved)
    return chosen(better, flat, found)


def product(a: Expansion, b: Expansion) -> Expansion:
    """A b, by its series alone."""
    whole = np.zeros((2 * ORDER + 1, *np.broadcast_shapes(a.remainder.shape, b.remainder.shape)))
    for k, each in enumerate(a.terms):
        whole[k : k + ORDER + 1] += each * b.terms
    terms, beyond = whole[: ORDER + 1], np.abs(whole[ORDER + 1 :]).sum(axis=0)
    sizes = np.abs(a.terms[0]), np.abs(b.terms[0])
    varies = a.variation * (sizes[1] + b.variation) + sizes[0] * b.variation - beyond
    off, size = beyond + a.remainder * b.size + b.remainder * (a.size - a.remainder), a.size * b.size
    unresolved = np.where(beyond * RESOLVED <= varies, a.unresolved * b.size + b.unresolved * a.size, off)
    return _known(terms, off + size * EXPANSION_ROUNDOFF, unresolved, sizes[0] * b.error + a.error * sizes[1])


def reciprocal(a: Expansion) -> Expansion:
    """1/a."""
    v = 1 / a.terms[0]
    return composed(a, (v, -(v**2), v**3, -(v**4)), np.abs(v) * geometric(a.deviation * np.abs(v)))


def geometric(share: Array) -> Array:
    """The powers of a share from the fourth on."""
    return np.where(share < 1, share**4 / (1 - share), np.inf)


def composed(a: Expansion, c: Sequence[Array], further: Array) -> Expansion:
    """A function with coefficients around the value of an expansion; ``further`` bounds its powers from the fourth."""
    _, first, second, third = a.terms
    by, one = a.deviation, np.abs(first)
    slope, bend, twist = (np.abs(each) for each in c[1:])
    varies = by * (slope + by * (bend + by * twist))
    beyond = bend * (by * by - one * (one + 2 * np.abs(second))) + twist * (by**3 - one**3) + further
    off, gain = slope * a.remainder + beyond, slope + by * (2 * bend + 3 * by * twist)
    unresolved = np.where(beyond * RESOLVED <= varies, a.unresolved * gain, off)
    terms = [
        c[0],
        c[1] * first,
        c[1] * second + c[2] * first * first,
        c[1] * third + first * (2 * c[2] * second + c[3] * first * first),
    ]
    return _known(np.stack(terms), off + (np.abs(c[0]) + varies) * EXPANSION_ROUNDOFF, unresolved, slope * a.error)


NOTHING_KNOWN = Expansion(np.zeros((ORDER + 1, 1)), np.full(1, np.inf), np.full(1, np.inf), np.zeros(1))


UNBOUNDED = frozenset({"sqrt"})  # its slope at the end of its domain: no range shows that


def _exponential(a: Expansion) -> Expansion:
    here, by = np.exp(a.terms[0]), a.deviation
    return composed(a, (here, here, here / 2, here / 6), by**4 / 24 * here * np.exp(by))


def _logarithm(a: Expansion) -> Expansion:
    value = np.where(a.terms[0] > 0, a.terms[0], np.nan)
    return composed(
        a, (np.log(value), 1 / value, -1 / value**2 / 2, 1 / value**3 / 3), geometric(a.deviation / value) / 4
    )


def _root(a: Expansion) -> Expansion:
    """Of the binomials of 1/2 the fourth, 5/128, is the largest from there on."""
    value = np.where(a.terms[0] > 0, a.terms[0], np.nan)
    s = np.sqrt(value)
    coefficients = s, s / value / 2, -s / value**2 / 8, s / value**3 / 16
    return composed(a, coefficients, s * 5 / 128 * geometric(a.deviation / value))


def _sine(a: Expansion, quarter: int = 0) -> Expansion:
    sine, cosine = np.sin(a.terms[0]), np.cos(a.terms[0])
    here, across = (cosine, -sine) if quarter else (sine, cosine)
    return composed(a, (here, across, -here / 2, -across / 6), a.deviation**4 / 24)


def _angle(a: Expansion) -> Expansion:
    x = a.terms[0]
    m = 1 / (1 + x * x)
    return composed(a, (np.arctan(x), m, -x * m * m, (x * x - 1 / 3) * m**3), geometric(a.deviation * np.sqrt(m)) / 4)


def _odd(function: Callable[[Expansion], Expansion]) -> Callable[[Expansion], Expansion]:
    """An odd function, by that of what is nowhere negative in the middle."""

    def expand(a: Expansion) -> Expansion:
        minus = a.terms[0] < 0
        found = function(chosen(minus, -a, a))
        return chosen(minus, -found, found)

    return expand


def _arc_sine(a: Expansion) -> Expansion:
    return FUNCTIONS["atan"](a / _root((_ONE - a) * (_ONE + a)))


def _turned(y: Expansion, x: Expansion) -> Expansion:
    """atan2: by how much it turns from the middle; it has no series where it may jump."""
    jumps = (x.range.low <= 0) & (y.range.low <= 0) & (y.range.high >= 0)
    v, u = line(y.terms[0], 0.0), line(x.terms[0], 0.0)
    along = x * u + y * v
    found = line(np.arctan2(y.terms[0], x.terms[0]), 0.0) + FUNCTIONS["atan"]((y * u - x * v) / along)
    return chosen(jumps | ~(along.range.low > 0), NOTHING_KNOWN, found)


def _power(base: Expansion, exponent: Expansion) -> Expansion:
    whole = float(exponent.terms[0, 0])
    if exponent.terms.shape[1] > 1 or not (0 < whole < np.inf and whole % 1 == 0):
        return FUNCTIONS["exp"](exponent * FUNCTIONS["log"](base))
    return at_most(repeated(product, int(whole), base), partial(repeated, Range.__mul__, int(whole)), base)


def _least(one: Expansion, other: Expansion) -> Expansion:
    apart, more = one.deviation + other.deviation, other.terms[0] - one.terms[0]
    return chosen(np.abs(more) > apart, chosen(more > 0, one, other), NOTHING_KNOWN)


def _below(number: Expansion, bound: Expansion, one: Expansion, other: Expansion) -> Expansion:
    more, apart = bound.terms[0] - number.terms[0], number.deviation + bound.deviation
    return chosen((more > apart) | (more <= -apart), chosen(more > 0, one, other), NOTHING_KNOWN)


def _bounded(name: str, series: Callable[..., Expansion]) -> Callable[..., Expansion]:
    """A function by its series, or all that it may be where less is hidden in that."""

    def expand(*arguments: Expansion) -> Expansion:
        found = series(*arguments)
        return found if name in UNBOUNDED else at_most(found, ENCLOSED.functions[name], *arguments)

    return expand


def _folded(name: str, series: Callable[[Expansion, Expansion], Expansion]) -> Callable[..., Expansion]:
    return lambda *arguments: reduce(_bounded(name, series), arguments)


def _constant(value: Fraction) -> Expansion:
    return line(float(value), 0.0)


_ONE, _TWO, _HALF = (_constant(Fraction(each)) for each in ("1", "2", "1/2"))
_PI, _E = line(np.pi, 0.0), line(np.e, 0.0)
_OF_ONE: dict[str, Callable[[Expansion], Expansion]] = {
    "exp": _exponential,
    "log": _logarithm,
    "sqrt": _root,
    "sin": _sine,
    "cos": partial(_sine, quarter=1),
    "tan": lambda a: FUNCTIONS["sin"](a) / FUNCTIONS["cos"](a),
    "atan": _angle,
    "tanh": _odd(lambda a: product(_TWO, reciprocal(_ONE + _exponential(product(-_TWO, a)))) - _ONE),
    "asin": _arc_sine,
    "acos": lambda a: _PI * _HALF - _arc_sine(a),
    "sinh": lambda a: (FUNCTIONS["exp"](a) - FUNCTIONS["exp"](-a)) * _HALF,
    "cosh": lambda a: (FUNCTIONS["exp"](a) + FUNCTIONS["exp"](-a)) * _HALF,
    "asinh": _odd(lambda a: FUNCTIONS["log"](a + _root(a * a + _ONE))),
    "acosh": lambda a: FUNCTIONS["log"](a + _root(a * a - _ONE)),
    "atanh": lambda a: FUNCTIONS["log"]((_ONE + a) / (_ONE - a)) * _HALF,
    "abs": lambda a: chosen(np.abs(a.terms[0]) > a.deviation, chosen(a.terms[0] < 0, -a, a), NOTHING_KNOWN),
    **dict.fromkeys(("sign", "floor", "heaviside"), lambda _: NOTHING_KNOWN),  # of steps
}
FUNCTIONS: dict[str, Any] = {name: _bounded(name, series) for name, series in _OF_ONE.items()} | {
    "atan2": _bounded("atan2", _turned),
    "pow": _power,
    "below": _bounded("below", _below),
    "min": _folded("min", _least),
    "max": _folded("max", lambda one, other: -_least(-one, -other)),
    "pi": _PI,
    "e": _E,
    "nan": NOTHING_KNOWN,
}

EXPANDED = Arithmetic(
    name="expansion",
    digits=None,
    bits=53,
    unit=2.0**-53,
    constant=_constant,
    isfinite=lambda value: bool(np.all(np.isfinite(value.remainder))),
    functions=FUNCTIONS,
)
