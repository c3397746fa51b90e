"""Shortest paths through sequences of passages, as convex problems: a feasible path above, a feasible dual below.

With unknowns s (a point on each guard, in its own coordinates) every straight leg of the path is ``M s + o``, so its
length is a norm of affine functions, to be minimised over a polyhedron: a second-order cone problem. Those of one
unknown are minimised here, many at once. For the others a solver (Clarabel) proposes, and bounds are computed from its
proposals; a problem is solved around its last answer, in units of its value, until the gap is small or stops shrinking.

Both ends are charged for rounding, so that they hold for a model's exact numbers, each of which was rounded once. A
path is made to keep its inequalities by more than that, and pays for what its guard points may be off. A bound from
below holds for the exact legs and rows, wherever the unknowns of a path as short as the one at hand can be.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib import import_module
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.metrics.geometry import Array, Gate, Passage, Space
from hsdsl.base.numbers.bernstein import UNIT

if TYPE_CHECKING:
    from hsdsl.base.numbers.bernstein import Array


@dataclass(eq=False)
class ConeShape:
    """What problems share: minimise the sum of ``|matrices[i] @ s + offset|`` over unit ``normals @ s <= levels``.

    A problem's offsets, one leg after the other, are those of its two ends and ``bases``; ``numbers`` is the size of
    all these. ``inner`` is a point at which every inequality holds with some ``room``, if one is known, and ``gates``
    are those whose coordinates the unknowns are.
    """

    matrices: tuple[Array, ...]
    normals: Array
    levels: Array
    inner: Array | None = None
    room: Array | None = None
    gates: tuple[Gate, ...] = ()
    bases: Array = field(default_factory=lambda: np.zeros(0))
    numbers: float = 0.0
    cone: Any = None  # as the conic solver takes it, once it was needed

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.normals.shape[1]

    @cached_property
    def stacked(self) -> Array:
        """All matrices, one below the other."""
        return np.vstack(self.matrices)

    @cached_property
    def parts(self) -> list[slice]:
        """Which of its rows each matrix is."""
        ends = np.cumsum([0, *(len(m) for m in self.matrices)]).tolist()
        return [slice(a, b) for a, b in pairwise(ends)]

    @cached_property
    def back(self) -> Array:
        """Its pseudo-inverse."""
        found: Any = np.linalg.pinv(self.stacked, rcond=max(self.stacked.shape) * 2 * UNIT)
        return found

    @cached_property
    def spread(self) -> float:
        """How much the legs together can change with the unknowns, for each unit of their length."""
        return float(sum(np.linalg.norm(m) for m in self.matrices))

    @cached_property
    def operations(self) -> int:
        """How many roundings can meet in one number."""
        return sum(self.stacked.shape) + len(self.levels) + 10

    @cached_property
    def least(self) -> float:
        """How much the legs together change at least; 0 where rounding leaves that open."""
        if self.size == 0:
            return 0.0
        values = np.linalg.svd(self.stacked, compute_uv=False)
        least = float(values[-1]) if len(values) == self.size else 0.0
        return max(0.0, least - self.operations * UNIT * float(np.linalg.norm(self.stacked)))

    @cached_property
    def radius(self) -> float:
        """How long the vector of unknowns can be; infinite where a guard has no end, or none is known."""
        return float(np.linalg.norm([gate.radius for gate in self.gates])) if self.gates else np.inf


class GateSequence:
    """A sequence of passages: its legs, to which the two ends are added by :meth:`problem`.

    ``enters`` and ``leaves`` are the points where each is entered and left, as maps of all unknowns: base, then frame.
    """

    def __init__(self, space: Space, passages: Sequence[Passage]) -> None:
        self.space, self.passages = space, tuple(passages)
        self.gates = tuple(p.gate for p in passages)
        firsts = np.cumsum([0, *(gate.size for gate in self.gates)]).tolist()
        rows = np.cumsum([0, *(len(gate.levels) for gate in self.gates)]).tolist()
        self.normals = np.zeros((rows[-1], firsts[-1]))
        self.enters: list[Array] = []
        self.leaves: list[Array] = []
        for passage, first, row in zip(self.passages, firsts, rows, strict=False):
            gate = passage.gate
            self.normals[row : row + len(gate.levels), first : first + gate.size] = gate.normals
            for sides, side in ((self.enters, passage.enter), (self.leaves, passage.leave)):
                wide = np.zeros((len(side), 1 + firsts[-1]))
                wide[:, 0], wide[:, 1 + first : 1 + first + gate.size] = side[:, 0], side[:, 1:]
                sides.append(wide)
        self.shapes: dict[tuple[bool, bool, bool], ConeShape] = {}

    def problem(self, p: Array | None, q: Array | None, kept: bool = False) -> tuple[ConeShape, Array, Array]:
        """The problems between pairs, rows of p and q: their shape, offsets, and the size of their numbers.

        There is no first or last leg where p or q is None. With ``kept`` the last leg measures only the coordinates
        that no passage changes, to a q in any mode given by those coordinates alone: a lower bound for all that may
        come after.
        """
        shape = self.shape(p is not None, q is not None, kept)
        count = next((len(x) for x in (p, q) if x is not None), 1)
        offsets, numbers = np.tile(shape.bases, (count, 1)), np.full(count, shape.numbers)
        for end, leg in ((p, 0), (q, -1)):
            if end is not None:
                offsets[:, shape.parts[leg]] -= end
                numbers += norm(end)
        return shape, offsets, numbers

    def shape(self, first: bool, last: bool, kept: bool = False) -> ConeShape:
        """What problems with or without a first and a last leg share."""
        found = self.shapes.get((first, last, kept))
        if found is None:
            between = list(zip(self.leaves, self.enters[1:], strict=False))
            end = self.leaves[-1]
            if kept and self.space.kept is not None:
                end = end[list(self.space.kept[self.passages[-1].target])]
            legs = self.enters[:1] * first + [into - out for out, into in between] + [end] * last
            ends = [*self.enters[: int(first)], *(side for pair in between for side in pair), *[end] * last]
            levels, inner, room = (
                np.concatenate([np.zeros(0), *(getattr(gate, name) for gate in self.gates)])
                for name in ("levels", "inner", "room")
            )
            bases = np.concatenate([np.zeros(0), *(leg[:, 0] for leg in legs)])
            numbers = sum(float(np.linalg.norm(side[:, 0])) for side in ends)
            matrices = tuple(leg[:, 1:] for leg in legs)
            found = ConeShape(matrices, self.normals, levels, inner, room, self.gates, bases, numbers)
            self.shapes[first, last, kept] = found
        return found

    def sides(self, s: Array) -> list[tuple[Array, Array]]:
        """Where each passage is entered and left, for unknowns s."""
        at = np.append(1.0, s)
        return [(enter @ at, leave @ at) for enter, leave in zip(self.enters, self.leaves, strict=True)]


def gate_sequence(space: Space, indices: tuple[int, ...]) -> GateSequence:
    """The chain of a sequence of passages, made once."""
    passages = (space.passages[i] if i >= 0 else space.planes[~i] for i in indices)
    return space.remembered(("chain", indices), lambda: GateSequence(space, list(passages)))


GAP = 1e-10  # relative
SOLVED, ROUGHLY = 1e-12, 1e-8  # the solver's tolerance, and the one of a single round
ROUNDS = 3


@contextmanager
def one_thread() -> Generator[None]:
    """Keep BLAS and LAPACK on the calling thread: for twenty unknowns others cost more than they bring."""
    with _controller().limit(limits=1, user_api="blas"):
        yield


@cache
def _controller() -> Any:
    import_module("scipy.optimize")  # its own copy of the library has to be loaded to be found
    return import_module("threadpoolctl").ThreadpoolController()


def solve(shape: ConeShape, offsets: Array, numbers: Array, rounds: int = ROUNDS) -> tuple[Array, Array, Array]:
    """Minimise B problems of one shape, with offsets (B, n) and numbers of sizes (B,), in at most so many rounds.

    Returns lower and upper ends (B,), see `metrics.rounding`, and where the upper ones are attained, (B, N).
    """
    if not shape.matrices:
        return np.zeros(len(numbers)), np.zeros(len(numbers)), np.zeros((len(numbers), shape.size))
    if shape.size < 2:
        return on_line(shape, offsets, numbers)
    best = -offsets @ shape.back.T
    unit = np.maximum(np.maximum(lengths(shape, offsets, best), charge(shape, numbers, norm(best))), 1e-300)
    lower, upper, todo = np.zeros(len(numbers)), np.full(len(numbers), np.inf), np.arange(len(numbers))
    for _ in range(rounds):
        some = offsets[todo]
        s, vectors, weights = _proposals(shape, some, best[todo], unit[todo], SOLVED if rounds > 1 else ROUGHLY)
        s, inside = brought_inside(shape, s)
        value = lengths(shape, some, s)
        above = value * (1 + shape.operations * UNIT) + charge(shape, numbers[todo], norm(s))
        value = np.where(inside, above, np.inf)
        below = proved_below(shape, some, numbers[todo], s, vectors, weights)
        lower[todo] = np.maximum(lower[todo], below)
        better = value < upper[todo]
        best[todo[better]], upper[todo[better]] = s[better], value[better]
        rounding = 2 * charge(shape, numbers[todo], norm(best[todo]))
        unit[todo] = np.maximum(upper[todo], rounding)
        todo = todo[upper[todo] - lower[todo] > np.maximum(GAP * upper[todo], rounding)]
        if not todo.size:
            break
    return lower, upper, best


def _proposals(
    shape: ConeShape, offsets: Array, centers: Array, units: Array, tolerance: float
) -> tuple[Array, Array, Array]:
    """Solve each problem for ``s = center + unit * sigma``: proposed unknowns, the legs' vectors, and weights."""
    clarabel: Any = import_module("clarabel")  # heavy, so not before it is needed
    if shape.cone is None:
        shape.cone = _cone(shape, clarabel)
    cost, matrix, objective, cones = shape.cone
    # Each leg is a cone of its bound and its vector, after the inequalities.
    rows = len(shape.levels)
    bounds = rows + np.array([part.start + k for k, part in enumerate(shape.parts)])
    right = np.zeros((len(centers), rows + len(bounds) + len(shape.stacked)))
    vectors = np.delete(np.arange(right.shape[1]), bounds)[rows:]
    right[:, :rows] = shape.levels - centers @ shape.normals.T
    right[:, vectors] = centers @ shape.stacked.T + offsets
    right /= units[:, None]
    s, dual, solver = centers.copy(), np.zeros_like(right), None
    for k in np.flatnonzero(np.all(np.isfinite(right), axis=1)).tolist():
        if solver is None:
            solver = clarabel.DefaultSolver(cost, objective, matrix, right[k], cones, _settings(clarabel, tolerance))
        else:
            solver.update(b=right[k])
        answer: Any = solver.solve()
        s[k], dual[k] = centers[k] + units[k] * np.asarray(answer.x)[: shape.size], answer.z
    lost = ~(np.all(np.isfinite(s), axis=1) & np.all(np.isfinite(dual), axis=1))
    s[lost], dual[lost] = centers[lost], 0.0
    return s, -dual[:, vectors], dual[:, :rows]


def _cone(shape: ConeShape, clarabel: Any) -> tuple[Any, Any, Array, list[Any]]:
    """What the solver takes that offsets do not change: a bound for each leg is one more unknown."""
    sparse: Any = import_module("scipy.sparse")
    size, legs = shape.size, len(shape.matrices)
    rows, cones = [np.hstack([shape.normals, np.zeros((len(shape.levels), legs))])], list[Any]()
    if len(shape.levels):
        cones.append(clarabel.NonnegativeConeT(len(shape.levels)))
    for i, matrix in enumerate(shape.matrices):
        block = np.zeros((1 + len(matrix), size + legs))
        block[0, size + i] = -1.0
        block[1:, :size] = -matrix
        rows.append(block)
        cones.append(clarabel.SecondOrderConeT(1 + len(matrix)))
    objective = np.concatenate([np.zeros(size), np.ones(legs)])
    dense = np.vstack(rows).T
    columns, places = dense.nonzero()
    ends = np.searchsorted(columns, np.arange(size + legs + 1))
    matrix = sparse.csc_matrix((dense[columns, places], places, ends), shape=dense.shape[::-1])
    return sparse.csc_matrix((size + legs, size + legs)), matrix, objective, cones


@cache
def _settings(clarabel: Any, tolerance: float) -> Any:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    settings.max_iter = 60
    settings.presolve_enable = False  # else a solver takes no other offsets
    return settings


ITERATIONS = 100


def on_line(shape: ConeShape, offsets: Array, numbers: Array) -> tuple[Array, Array, Array]:
    """Minimise a shape's problems of at most one unknown, both ends charged with rounding; s is (N, 0) or (N, 1).

    Rounding moves the interval's ends by less than the legs are charged for.
    """
    if shape.size == 0:
        s, far = np.zeros((len(numbers), 0)), np.zeros(len(numbers))
        lower = upper = lengths(shape, offsets, s)
    else:
        low, high = interval_of(shape.normals, shape.levels)
        along = [(offsets[:, part], shape.stacked[part, 0]) for part in shape.parts]
        kinks = [np.clip(-(o @ m) / (m @ m), low, high) for o, m in along if m @ m > 0]
        kinks = np.array(kinks or [np.full(len(offsets), np.clip(0.0, low, high))])
        a, b = kinks.min(axis=0), kinks.max(axis=0)
        values = np.array([lengths(shape, offsets, s[:, None]) for s in kinks])
        first = np.argmin(values, axis=0)[None]
        best, where = (np.take_along_axis(x, first, axis=0)[0] for x in (values, kinks))
        wide = np.flatnonzero(b - a > 4e-16 * (np.abs(a) + np.abs(b)))
        lower = best.copy()
        if wide.size:
            low_wide, value, at = _newton(shape, offsets[wide], a[wide], b[wide])
            better = value < best[wide]
            best[wide] = np.where(better, value, best[wide])
            where[wide] = np.where(better, at, where[wide])
            lower[wide] = np.minimum(low_wide, best[wide])
        upper, far = best, np.maximum(np.abs(a), np.abs(b))
        s = where[:, None]
        if shape.least > 0:  # no shorter path is farther away
            far = np.minimum(far, np.abs(where) + 2 * upper / shape.least)
    rounding = charge(shape, numbers, far) + shape.operations * UNIT * upper
    return np.maximum(0.0, lower - rounding), upper + rounding, s


def _newton(shape: ConeShape, offsets: Array, a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Newton's method on the slope, between a and b, halving where it leaves them.

    The sum is convex, so its tangent at any point bounds it from below.
    """
    s, lower, value = 0.5 * (a + b), np.full(len(a), -np.inf), np.full(len(a), np.inf)
    where = s.copy()
    left = np.arange(len(a))
    for _ in range(ITERATIONS):
        at, slope, bend = _expanded(shape, offsets[left], s)
        loose = 4e-16 * shape.spread * (b - a)
        below = at + np.minimum(slope * (a - s), slope * (b - s)) - loose
        better = at < value[left]
        where[left] = np.where(better, s, where[left])
        value[left], lower[left] = np.minimum(value[left], at), np.maximum(lower[left], below)
        a, b = np.where(slope > 0, a, s), np.where(slope > 0, s, b)
        middle = 0.5 * (a + b)
        step = s - np.divide(slope, bend, out=np.full_like(s, np.inf), where=bend > 0)
        s = np.where((step > a) & (step < b), step, middle)
        open_ = (value[left] - lower[left] > 2 * loose + 2e-16 * value[left]) & (middle > a) & (middle < b)
        left, a, b, s = left[open_], a[open_], b[open_], s[open_]
        if not left.size:
            break
    return np.minimum(lower, value), value, where


def _expanded(shape: ConeShape, offsets: Array, s: Array) -> tuple[Array, Array, Array]:
    """The sum, its slope and its second derivative."""
    total, slope, bend = np.zeros((3, len(s)))
    for part in shape.parts:
        m = shape.stacked[part, 0]
        leg = offsets[:, part] + s[:, None] * m
        size = norm(leg)
        inverse = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
        along = (leg @ m) * inverse
        total += size
        slope += along
        bend += (float(m @ m) - along * along) * inverse
    return total, slope, bend


def interval_of(normals: Array, levels: Array) -> tuple[float, float]:
    """The interval that inequalities leave to one unknown."""
    slopes = normals[:, 0]
    bounds = levels / slopes
    low = float(np.max(bounds[slopes < 0], initial=-np.inf))
    high = float(np.min(bounds[slopes > 0], initial=np.inf))
    return low, max(low, high)


MOVES = 20  # of moving points onto the inequality that is broken most


def norm(rows: Array) -> Array:
    """Euclidean norms of rows."""
    if rows.shape[1] == 2:
        return np.hypot(rows[:, 0], rows[:, 1])
    return np.sqrt(np.einsum("bi,bi->b", rows, rows))


def lengths(shape: ConeShape, offsets: Array, s: Array) -> Array:
    """The lengths of B paths at unknowns s, shape (B, N), to rounding."""
    legs = s @ shape.stacked.T + offsets
    return sum((norm(legs[:, part]) for part in shape.parts), np.zeros(len(s)))


def charge(shape: ConeShape, numbers: Array, far: Array) -> Array:
    """What the legs' rounding amounts to, for unknowns whose vectors are as long as ``far``."""
    return shape.operations * UNIT * (numbers + shape.spread * far)


def brought_inside(shape: ConeShape, s: Array) -> tuple[Array, Array]:
    """Move points to where all exact inequalities hold, and say which got there.

    First onto the inequality that is broken most, again and again; what is left goes towards the inner point.
    """
    normals, levels = shape.normals, shape.levels
    if not len(levels):
        return s, np.ones(len(s), dtype=bool)
    beyond = _beyond(shape, s)
    for _ in range(MOVES):
        out = np.flatnonzero(beyond.max(axis=1) > 0)
        if not out.size:
            return s, np.ones(len(s), dtype=bool)
        worst = np.argmax(beyond[out], axis=1)
        s = s.copy()
        # Twice the margin, else it would be broken again by rounding.
        over = beyond[out, worst] + _margin(shape, s[out])[np.arange(len(out)), worst]
        s[out] -= over[:, None] * normals[worst]
        beyond = _beyond(shape, s)
    if shape.inner is not None and shape.room is not None:
        over = np.where(beyond > 0, beyond + _margin(shape, s), 0.0)  # twice the margin, as above
        room = np.maximum(shape.room - _margin(shape, shape.inner[None]), 1e-300)
        share = np.minimum(1.0, (1 + 1e-9) * (over / (over + room)).max(axis=1))
        s = s + share[:, None] * (shape.inner - s)
        beyond = _beyond(shape, s)
    return s, beyond.max(axis=1) <= 0


def _beyond(shape: ConeShape, s: Array) -> Array:
    return s @ shape.normals.T - shape.levels + _margin(shape, s)


def _margin(shape: ConeShape, s: Array) -> Array:
    return shape.operations * UNIT * (norm(s)[:, None] + np.abs(shape.levels))


def proved_below(shape: ConeShape, offsets: Array, numbers: Array, s: Array, vectors: Array, weights: Array) -> Array:
    """Lower bounds on the minima from proposals for a dual: a unit vector y for each leg, a weight w for each row.

    For any unknowns s' of a path no longer than that at s, with the legs u at s and the residual ``r = M'y + C'w``,

        sum |M s' + o| >= y u - w (d - C s) + r (s' - s),

    and s' is not far from s: the legs of both are known to be short. Longer paths are longer than that at s.
    """
    weights = np.maximum(np.nan_to_num(weights), 0.0)
    flat = np.nan_to_num(vectors)
    for _ in range(2):
        flat = flat - (flat @ shape.stacked + weights @ shape.normals) @ shape.back
    longest = np.max([norm(flat[:, where]) for where in shape.parts], axis=0)
    shrink = (1 - shape.operations * UNIT) / np.maximum(1.0, longest)
    flat, weights = flat * shrink[:, None], weights * shrink[:, None]
    value = np.einsum("bi,bi->b", flat, s @ shape.stacked.T + offsets)
    value -= np.einsum("bj,bj->b", weights, shape.levels - s @ shape.normals.T)
    longest_path, far = lengths(shape, offsets, s), norm(s)
    if np.all(value <= charge(shape, numbers, far)):  # nothing is left of it, wherever the unknowns may be
        return np.zeros(len(value))
    # How far from s the unknowns of a path can be that is no longer than the one at s
    near = (
        (2 * longest_path + charge(shape, numbers, far)) * (1 + 1e-9) / shape.least
        if shape.least > 0
        else shape.radius + far
    )
    heavy = weights.sum(axis=1)
    residual = norm(flat @ shape.stacked + weights @ shape.normals)
    with np.errstate(invalid="ignore"):  # nothing times an unbounded reach: no bound
        rounding = charge(shape, numbers, far + near) + residual * near
        rounding += shape.operations * UNIT * (heavy * (far + near) + weights @ np.abs(shape.levels))
        value = np.nan_to_num(value - rounding)
    return np.maximum(0.0, np.minimum(value, longest_path * (1 - shape.operations * UNIT)))
