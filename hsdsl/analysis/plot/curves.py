"""What a picture shows of runs, as curves: smooth to look at, thin enough to draw, broken where a run jumps."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate, groupby, pairwise
from typing import NamedTuple

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.names import SINCE, checks_methods, did_you_mean, without_memory
from hsdsl.base.numbers.decimals import number_of
from hsdsl.engine.execution import Array, Execution, Samples
from hsdsl.engine.execution.run import evaluate
from hsdsl.mathematics.program import ModeProgram, Program

POINTS = 4000  # that a curve should have at least, where its pieces are not straight
CELLS = 3000  # of the picture's width and height: two points in one cell look like one
BANDS = 400  # with more changes of mode than this, time is cut into BINS and a bin may be of several modes
BINS = 1500
STAYS, MOST_SHARES = 12, 300  # stays in modes that a bin of shares has, and the most bins
MOVING = 1000  # points of a guard that moves
MOST_PANELS = 6  # with one column each, where nobody chose them and parts are alike
INDEX = re.compile(r"\[(\d+)\]")
SEVERAL = "several modes"
SMALL = 1e-10  # of the largest state
ROUND_OFF = 1e-12  # of the size of a state
CLOSE = 1e-9  # of a period


class GuardLine(NamedTuple):
    """A guard that is a level of one state: in ``mode`` something fires where ``state`` reaches ``value``.

    A guard that moves has its values at times in ``moving``, and not-a-number for ``value``.
    """

    mode: str
    state: str
    value: float
    label: str
    moving: Callable[[Array], Array] | None = None


class Shares(NamedTuple):
    """Times at which bins begin, and the last one's end, (n + 1,); by mode the share of each bin's time, (n,)."""

    edges: Array
    of: dict[str, Array]


@dataclass(frozen=True, eq=False)
class Curves:
    """The points of a run, in float64.

    ``begins`` marks the first point of each arc, ``jumps`` are the indices of points after transitions. ``bands`` are
    the times at which modes were occupied, without those too short to see; `SEVERAL` where they are too many, and then
    ``shares`` says how much of a time each mode takes.
    ``error`` is how much of its size a state may be off: one that changes by less is drawn as a constant. ``parts`` is
    for each jump the name of the part that its edge is of, or nothing. ``zeros`` are states that are zero to round-off.
    """

    samples: Samples
    begins: Array
    jumps: Array
    bands: list[tuple[str, float, float]]
    ends_badly: bool = False
    error: float = ROUND_OFF
    shares: Shares | None = None
    parts: Sequence[str] = ()
    zeros: frozenset[str] = frozenset()

    def jumps_of(self, name: str) -> Array:
        """The jumps that a column of a part may make: those of the part, and of what is in no part."""
        own = name.rpartition(".")[0]
        if not own or len(self.parts) != len(self.jumps):
            return self.jumps
        return self.jumps[[part in ("", own) for part in self.parts]]

    @property
    def span(self) -> tuple[float, float]:
        """The first and the last time."""
        return float(self.samples.time[0]), float(self.samples.time[-1])

    @property
    def modes(self) -> tuple[str, ...]:
        """The modes of the bands, in the order of their first."""
        return tuple(dict.fromkeys(mode for mode, _, _ in self.bands))

    def has_values(self, name: str) -> bool:
        """Whether a state or output has a number anywhere."""
        return bool(np.isfinite(self.column(name)).any())

    def column(self, name: str) -> Array:
        """Return a state or output, not-a-number where there is nothing to draw."""
        if name not in self.samples.names:
            return np.full(len(self.samples), np.nan)
        values = 0 * self.samples[name] if name in self.zeros else self.samples[name]
        return np.where(np.isfinite(values), values, np.nan)


def moving_levels(runs: Sequence[Curves], guards: Sequence[GuardLine]) -> Iterator[tuple[GuardLine, Array, Array]]:
    """Each guard that moves, times of each run, and its values there; finite at most while its mode is occupied."""
    for guard in guards:
        for run in runs if guard.moving else ():
            own = [(begin, end) for mode, begin, end in run.bands if mode in (guard.mode, SEVERAL)]
            times = np.linspace(*run.span, MOVING)
            inside = np.any([(begin <= times) & (times <= end) for begin, end in own], axis=0) if own else times < 0
            assert guard.moving is not None
            yield guard, times, np.where(inside, guard.moving(times), np.nan)


def modes_of(runs: Sequence[Curves]) -> tuple[str, ...]:
    """Return the modes of all runs, in the order of their first."""
    return tuple(dict.fromkeys(mode for run in runs for mode in run.modes))


def curves(execution: Execution) -> Curves:
    """Make the curves of a run."""
    run = _in_float64(execution)
    n = len(run.times)
    duration = np.diff(run.times, append=run.times[-1])
    parts = np.ones(n, dtype=int)
    if run.coefficients.shape[1] > 1 or run.output_function is not None:
        share = np.maximum(duration / max(float(duration.sum()), np.finfo(float).tiny), 1 / n)
        parts = np.where(duration > 0, np.maximum(np.ceil(POINTS * share), 1), 1).astype(int)
    for arc in run.arcs:
        parts[arc.last] = 1
        if arc.kind == "strip":
            parts[arc.first : arc.last] = 1
    rows = np.repeat(np.arange(n), parts)
    within = np.arange(len(rows)) - np.repeat(np.cumsum(parts) - parts, parts)
    times = run.times[rows] + duration[rows] * (within / parts[rows])
    samples = evaluate(run, rows, times)
    first = np.array([arc.first for arc in run.arcs])
    begins = np.zeros(len(rows), dtype=bool)
    begins[np.searchsorted(rows, first)] = True
    jumps = np.flatnonzero(np.diff(samples.jump)) + 1
    error = max(ROUND_OFF, 10 * float(run.settings.get("tolerance") or 0))
    stays = merged([(arc.mode, float(run.times[arc.first]), float(run.times[arc.last])) for arc in run.arcs])
    shares = _shares(stays) if len(stays) > BANDS else None
    parts = [made.edge.rpartition(".")[0] for made in run.transitions]
    zeros = _zeros(execution)
    return Curves(samples, begins, jumps, _bands(stays), not run.stop.complete, error, shares, parts, zeros)


def _zeros(execution: Execution) -> frozenset[str]:
    """The states that are zero but for round-off: the run's shadow shows that they may be off by all that they are.

    Only states far smaller than others are looked at.
    """
    from hsdsl.engine.simulate.compiled import CompiledRun
    from hsdsl.engine.simulate.verdict import RunView
    from hsdsl.engine.simulate.verdict.shadow import has_shadow

    sizes, run = execution.sizes(), execution.compiled
    small = [name for name, size in sizes.items() if 0 < size < SMALL * max(sizes.values())]
    if not small or not isinstance(run, CompiledRun) or not has_shadow(run.plan.problem, execution):
        return frozenset()
    errors = RunView(run.plan.problem, execution, by_shadow=True).errors
    assert errors is not None
    off = np.max(errors.by_row, axis=0)
    return frozenset(name for name in small if not sizes[name] > off[errors.columns[name]])


def lap(run: Curves, period: float) -> Curves:
    """Cut off what is after one period; the jump at its end stays."""
    count = int(np.searchsorted(run.samples.time, period * (1 + CLOSE), side="right"))
    samples, begins = run.samples.at(slice(count)), run.begins[:count]
    bands = [(mode, begin, min(end, period)) for mode, begin, end in run.bands if begin < period * (1 - CLOSE)]
    return replace(run, samples=samples, begins=begins, jumps=run.jumps[run.jumps < count], bands=bands)


def _in_float64(execution: Execution) -> Execution:
    if execution.digits is None:
        return execution
    columns = ("times", "values", "outputs", "depth", "coefficients")
    return replace(execution, digits=None, **{name: getattr(execution, name).astype(float) for name in columns})


def _shares(stays: list[tuple[str, float, float]]) -> Shares:
    """The share of each mode in bins that have some stays each."""
    ends: list[float] = [stays[0][1], *(end for _, _, end in stays)]
    edges: list[float] = np.linspace(ends[0], ends[-1], min(MOST_SHARES, len(stays) // STAYS) + 1).tolist()
    found: dict[str, Array] = {}
    for mode in dict.fromkeys(mode for mode, _, _ in stays):
        lasted = [(end - begin) * (name == mode) for name, begin, end in stays]
        found[mode] = np.diff(np.interp(edges, ends, [0.0, *accumulate(lasted)])) / np.diff(edges)
    return Shares(np.array(edges), found)


def _bands(bands: list[tuple[str, float, float]]) -> list[tuple[str, float, float]]:
    if len(bands) <= BANDS:
        if not bands:
            return bands
        start, end = bands[0][1], bands[-1][2]
        wide = [band for band in bands if band[2] - band[1] >= (end - start) / CELLS]
        begins = [start, *(band[1] for band in wide[1:]), end]
        return merged([(band[0], *span) for band, span in zip(wide, pairwise(begins), strict=True)])
    edges = np.linspace(bands[0][1], bands[-1][2], BINS + 1)
    begins, ends = np.array([band[1] for band in bands]), np.array([band[2] for band in bands])
    earliest: list[int] = np.searchsorted(ends, edges[:-1], side="right").tolist()
    latest: list[int] = (np.searchsorted(begins, edges[1:], side="left") - 1).tolist()
    modes = [bands[i][0] if i == k else SEVERAL for i, k in zip(earliest, latest, strict=True)]
    return merged(list(zip(modes, edges[:-1].tolist(), edges[1:].tolist(), strict=True)))


def merged(bands: list[tuple[str, float, float]]) -> list[tuple[str, float, float]]:
    """Make one band of those that follow each other in one mode."""
    lasting = (band for band in bands if band[1] != band[2])
    groups = (list(group) for _, group in groupby(lasting, key=lambda band: band[0]))
    return [(group[0][0], group[0][1], group[-1][2]) for group in groups]


def line(x: Array, y: Array, begins: Array, limits: tuple[float, float, float, float]) -> tuple[Array, Array]:
    """Make a line to draw: not-a-number where an arc begins elsewhere, and no two points in a row in one cell."""
    x0, x1, y0, y1 = limits
    with np.errstate(invalid="ignore", over="ignore"):
        cells = np.stack([(x - x0) / (x1 - x0) * CELLS, (y - y0) / (y1 - y0) * CELLS])
        cells = np.round(np.clip(np.nan_to_num(cells, nan=-9e9), -9e9, 9e9))
    moved = np.any(np.diff(cells, axis=1) != 0, axis=0)
    broken = begins[1:] & ((x[1:] != x[:-1]) | (y[1:] != y[:-1])) & moved
    keep = np.ones(len(x), dtype=bool)
    keep[1:-1] = moved[:-1] | broken[1:]  # the last point before a break must stay
    where = np.flatnonzero(np.concatenate([[False], broken])[keep])
    return np.insert(x[keep], where, np.nan), np.insert(y[keep], where, np.nan)


def limits_of(runs: Sequence[Curves], name: str) -> tuple[float, float]:
    """Choose the ends of an axis on which all runs are."""
    ends = [
        limits(run.column(name), run.samples.time, run.ends_badly, run.error) for run in runs if run.has_values(name)
    ]
    return (min(low for low, _ in ends), max(high for _, high in ends)) if ends else (-1.0, 1.0)


def limits(values: Array, time: Array, ends_badly: bool, error: float = ROUND_OFF) -> tuple[float, float]:
    """Choose the lower and upper end of an axis.

    A range within the error of the values is shown as constant; small values are not. Where the run ended badly
    its last values are arbitrary, and the last thirtieth of the time does not count.
    """
    if ends_badly and len(time) > 1:
        before = time <= time[0] + 0.97 * (time[-1] - time[0])
        values = values[before] if np.isfinite(values[before]).any() else values
    finite = values[np.isfinite(values)]
    if not len(finite):
        return -1.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    size = max(abs(low), abs(high))
    if high - low <= error * size:
        room = 0.1 * size or 1.0
        return low - room, high + room
    room = high / 16 - low / 16
    return low - room, high + room


Pair = tuple[str, str]


@checks_methods
@dataclass(frozen=True)
class View:
    """What is shown of one run, or of several in one picture.

    ``columns`` are the states and outputs over time, in this order; None for all but those that only tell the time.
    ``phases`` are states or outputs against each other, across and up; None for one pair where all modes have the same
    two that flow, clocks aside.
    """

    columns: Sequence[str] | None = None
    phases: Sequence[Pair] | None = None
    guards: Sequence[GuardLine] = ()  # levels at which transitions fire
    units: Mapping[str, str] = field(default_factory=dict[str, str])  # of states and outputs, and of time by `t`
    title: str | None = None  # replaces the model's title (or its path, where it has none)
    labels: Sequence[str] = ()  # a name for each of several runs
    program: Program | None = None  # the model, whose mode graph is in a page

    def names(self, runs: Sequence[Execution]) -> list[str]:
        """Return the columns over time.

        Raises UsageError: a run has none of the name; the closest one is suggested.
        """
        known = names_of(runs)
        if self.columns is None:
            return [name for name in known if name not in self._timers(known)]
        return [checked(name, known) for name in dict.fromkeys(self.columns)]

    def panels(self, runs: Sequence[Execution]) -> dict[str, list[str]]:
        """Return the columns of each panel: one, or of a system of many parts those with the same name in each part."""
        names = self.names(runs)
        if self.columns is not None or len(names) <= MOST_PANELS:
            return {name: [name] for name in names}
        found: dict[str, list[str]] = {}
        for name in sorted(names, key=lambda name: [int(k) for k in INDEX.findall(name)]):
            found.setdefault(INDEX.sub("[*]", name), []).append(name)
        return {each[0] if len(each) == 1 else name: each for name, each in found.items()}

    def pairs(self, runs: Sequence[Execution]) -> list[Pair]:
        """Return the pairs of phase plots.

        Raises UsageError: as :meth:`names`.
        """
        known = names_of(runs)
        if self.phases is not None:
            return [(checked(across, known), checked(up, known)) for across, up in dict.fromkeys(self.phases)]
        held = {name for name, rate in self._rates().items() if number_of(rate) == 0}
        without = self._timers(known) | held  # counters, and what a controller holds

        def moving(states: Sequence[str]) -> list[str]:
            return [name for name in without_memory(states) if name not in without]

        states = list(dict.fromkeys(name for run in runs for name in moving(run.states)))
        shown = len(states) == 2 and all(
            len(moving(each)) == 2 for each in {a.states for run in runs for a in run.arcs}
        )
        return [(states[0], states[1])] if shown and set(states) <= set(self.names(runs)) else []

    def _timers(self, known: Sequence[str]) -> set[str]:
        """Names that only tell the time: `since`, and clocks that transitions set back; none where no other is known.

        A clock has one constant rate wherever it flows, and a transition that sets it to a constant.
        """
        made = [(edge.target_states[k], text) for mode in self._modes for edge in mode.edges
                for k, text in zip(edge.changes, edge.change_texts, strict=True)]  # fmt: skip
        running = {name for name, rate in self._rates().items() if number_of(rate) != 0}
        clocks = {name for name, text in made if self._is_constant(text)} & running
        found = {name for name in known if name.rpartition(".")[2] == SINCE or name in clocks}
        return found if found < set(known) else set()

    @property
    def _modes(self) -> Sequence[ModeProgram]:
        return () if self.program is None else self.program.modes

    def _rates(self) -> dict[str, str]:
        """States whose flow is one constant wherever they flow, with its text."""
        flows = {(name, text) for mode in self._modes for name, text in zip(mode.states, mode.flow_texts, strict=False)}
        different = Counter(name for name, _ in flows)
        return {name: text for name, text in flows if different[name] == 1 and self._is_constant(text)}

    def _is_constant(self, text: str) -> bool:
        """Whether a text is an expression of numbers and parameters alone."""
        known = ("pi", *(self.program.parameters if self.program else ()))
        try:
            nodes = list(ast.walk(ast.parse(text, mode="eval")))
        except SyntaxError:
            return False
        called = [node.func for node in nodes if isinstance(node, ast.Call)]
        return all(n.id in known for n in nodes if isinstance(n, ast.Name) and n not in called)

    def called(self, runs: Sequence[Execution]) -> list[str]:
        """Return a label for each run.

        Raises UsageError: there are labels, but not one for each.
        """
        if self.labels and len(self.labels) != len(runs):
            raise UsageError(f"expected {len(runs)} labels, one for each run, got {len(self.labels)}")
        return list(self.labels) or [f"run {k}" for k in range(1, len(runs) + 1)]


def names_of(runs: Iterable[Execution]) -> list[str]:
    """Return the states of all runs, then their outputs."""
    kept = list(runs)
    states = [name for run in kept for name in without_memory(run.states)]
    return list(dict.fromkeys([*states, *(name for run in kept for name in run.output_names)]))


def checked(name: str, known: Sequence[str]) -> str:
    """Refuse a name that is not among those known."""
    if name not in known:
        hint = did_you_mean(name, known) or "there are none"
        raise UsageError(f"no state or output is called {name}", hint)
    return name
