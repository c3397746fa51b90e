"""What a run reports first, for any verdict: remarks of the loop, of `misses` along its steps, and of its end.

Surfaces passed while an `if` was false and walls that do not hold are remarked by `misses` where that takes place. For
other runs, as those that are outside the theorem, they are searched at the rows of the run, and in eighths of steps on
which a surface rises at first and falls at last. States that come beyond a surface whose edge has an `if` without flow,
as a mode is entered or an input jumps, are searched at the first rows of arcs, with every verdict.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64, Number
from hsdsl.base.numbers.bernstein import Array
from hsdsl.base.numbers.enclosures import Range, Undecided, as_range
from hsdsl.base.numbers.roundoff import ROUNDOFF_UNITS
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.simulate.stops import (
    Diagnostics,
    Remark,
    codes_of,
    loop_remarks,
    may_be_passed,
    may_come_beyond,
    of_edge,
    wall_of,
    warnings_of,
)
from hsdsl.engine.simulate.verdict.crossings import sliding_spans
from hsdsl.engine.simulate.verdict.run_view import MOST_PARTS, ROUNDS, RunView
from hsdsl.mathematics.program import ModeProgram, Program

if TYPE_CHECKING:
    from numpy.typing import NDArray

BEYOND = 4  # times its round-off: a wall that does not hold
END = 1.0
HALVINGS, MANY = 14, 1024  # of steps beyond a surface; visits that are looked at together
Told = tuple[Sequence[Remark], Callable[[], Iterator[Remark]] | None, Program]
PARTS_OF_STEP = 8  # that turns back
POINTS = (*(i / PARTS_OF_STEP for i in range(PARTS_OF_STEP)), END)


@np.errstate(all="ignore")  # what overflows is no number, and is no remark
def _warned(verdict: Any) -> Any:
    remarks, later, program = verdict._told
    return warnings_of([*remarks, *later()] if later is not None else remarks, program)


# The warnings of a `Verdict.deferred` whose `_told` is what `told` returns.
WARNINGS: dict[str, Callable[[Any], Any]] = {"warnings": _warned}


def told(run: Callable[[], RunView], remarks: Sequence[Remark], program: Program, remarked: bool) -> Told:
    """What warnings are made of; a search at the rows of a run takes longer than many a run, and waits for a reader."""
    return remarks, (lambda: at_rows(run())) if remarked else None, program


def remarked(run: RunView, diagnostics: Diagnostics) -> list[Remark]:
    """The remarks about a run, without those of `at_rows`."""
    program = run.problem.program
    found = [*loop_remarks(program, diagnostics, run.stop)]
    found += (Remark("sliding", " and ".join(modes), start, end) for modes, start, end in sliding_spans(run))
    known, walls = run.remarks is not None, any(mode.walls for mode in program.modes)
    found += run.remarks or ()
    if (walls and (not known or run.problem.settings.scheme == "relaxed")) or (
        not known and any(may_be_passed(program, edge) for edge in program.edges)
    ):
        beyond = {remark.of for remark in found if remark.kind == "beyond"}
        found += (one for one in _passings(run, walls_alone=known) if one.kind != "beyond" or one.of not in beyond)
    return found


@np.errstate(all="ignore")
def noted(run: RunView, diagnostics: Diagnostics) -> str:
    """The codes of what needs no verdict, with a space between two, as the compiled loop finds them of ensembles."""
    kinds = {remark.kind for remark in loop_remarks(run.problem.program, diagnostics, run.stop)}
    kinds |= {"sliding" for _ in sliding_spans(run)}
    return codes_of(kinds | {remark.kind for remark in _entered(run)})


def at_rows(run: RunView) -> Iterator[Remark]:
    """Remarks about states at rows, which no hypothesis of the theorem concerns."""
    yield from at_the_end(run)
    yield from _entered(run)


def at_the_end(run: RunView) -> Iterator[Remark]:
    """Walls of the final mode that a run ended in: nothing flows there, so nothing has checked them."""
    modes = run.problem.program.modes
    if run.stop.reason != "final":
        return
    final = run.execution.final
    mode = modes[run.index(final.mode)]
    if tuple(final.state) != mode.states:
        return  # it has no flow, and the states of the mode before
    place = run.place(final.mode, final.time, tuple(final.state.values()))
    for k in range(len(mode.edges), len(mode.surfaces)):
        with suppress(*DOMAIN_ERRORS):
            if place.value(k) > BEYOND * place.roundoff_bound(k):
                yield Remark("beyond", wall_of(mode, k), final.time)


def _entered(run: RunView) -> Iterator[Remark]:
    """Remarks about edges with an `if` whose surfaces a state came beyond without flow, and stayed while it lasted.

    It enters a mode, or an input jumps, which may also carry it onto a surface.
    """
    program = run.problem.program
    if not may_come_beyond(program):
        return
    table, times = run.execution.arc_table, np.asarray(run.execution.times, dtype=float)
    starts = np.array([arc.first for arc in run.flows], dtype=np.int64)
    jumps = np.array([float(segment.start) for segment in run.problem.timeline.segments if segment.jump])
    for index, _, rows in run.rows_by_mode():
        mode = program.modes[index]
        conditional = [k for k, edge in enumerate(mode.edges) if may_be_passed(program, edge)]
        if mode.slides or not conditional or not len(rows):
            continue
        first = _Steps(run, index, rows[np.isin(rows, starts)])
        arc = np.searchsorted(table.first, first.rows, "right") - 1
        jumped = np.isin(times[first.rows], jumps) & (arc > 0) & (table.jump[arc] == table.jump[arc - 1])
        for k in conditional:
            name = mode.edges[k].name
            part = f"part {name.rpartition('.')[0]}" if program.parts else f"mode {mode.name}"
            entered = f"{part} entered" if program.parts else f"{part} was entered"
            with suppress(Undecided, *DOMAIN_ERRORS):
                side, before = first.sides(0.0, k), _sides_before(run, starts, first.rows, name)
                beyond, onto = (side > 0) & (before <= 0), jumped & (side == 0) & (before < 0)
                found = {row: "beyond" for row in _staying(run, index, first.rows[beyond].tolist(), k)}
                found |= {row: "onto" for row in first.rows[onto].tolist() if _stays_on(run, index, row, k)}
                by_input = dict(zip(first.rows.tolist(), jumped.tolist(), strict=True))
                for row, where in sorted(found.items()):
                    how = f"an input's jump carried {part}" if by_input[row] else entered
                    yield Remark("entered", f"{how} {where} the surface of {name}", run.times[row], edge=name)


def _sides_before(run: RunView, starts: NDArray[np.int64], rows: NDArray[np.int64], name: str) -> Array:
    """On which side of the surface of an edge of this name states were at the end of the flow before rows.

    They were inside where there was no such edge. ``starts`` are the first rows of all flows.
    """
    places: list[int] = (np.searchsorted(starts, rows) - 1).tolist()
    before = [run.flows[i] if i >= 0 else None for i in places]
    last = np.array([arc.last - 1 if arc else -1 for arc in before], dtype=np.int64)
    found, modes = np.full(len(rows), -1.0), np.array([run.index(arc.mode) if arc else -1 for arc in before])
    for index in set(modes[modes >= 0].tolist()):
        which = modes == index
        steps = _Steps(run, index, last[which])
        sides = [steps.sides(END, k) for k, edge in enumerate(steps.mode.edges) if edge.name == name]
        found[which] = np.max([found[which], *sides], axis=0)
    return found


def _stays_on(run: RunView, index: int, row: int, k: int) -> bool:
    """Whether a state stays on surface k, to round-off, until something else happens."""
    arc = run.arc_of(row)
    steps = _Steps(run, index, np.arange(arc.first, arc.last))
    return not (steps.sides(0.0, k).any() or steps.sides(END, k).any())


def _visit(run: RunView, row: int, k: int) -> NDArray[np.int64]:
    """The rows at which steps begin from a row on, until the mode is left, or a transition leaves surface k inside.

    Events and other parts of a system make transitions meanwhile.
    """
    place = bisect_right(run.flows, row, key=lambda arc: arc.first)
    first, later = run.flows[place - 1], (run.flows[i] for i in range(place, len(run.flows)))
    mode = run.index(first.mode)
    rest = takewhile(lambda arc: run.index(arc.mode) == mode and run.at_row(arc, arc.first).value(k) > 0, later)
    return np.concatenate([np.arange(arc.first, arc.last) for arc in (first, *rest)])


def _staying(run: RunView, index: int, entries: Sequence[int], k: int) -> list[int]:
    """Those of the rows at which visits of a mode begin whose states are surely beyond surface k all along."""
    from hsdsl.engine.simulate.verdict.steps import Parts, high, low, parts_at, undecided  # few runs have such a visit

    if not 0 < len(entries) <= MANY:
        return [row for i in range(0, len(entries), MANY) for row in _staying(run, index, entries[i : i + MANY], k)]
    visits = [_visit(run, row, k) for row in entries]
    rows, of_visit = np.concatenate(visits), np.repeat(np.arange(len(visits)), [len(visit) for visit in visits])
    inside = np.zeros(len(visits), dtype=bool)

    def decides(parts: Parts) -> NDArray[np.bool_]:
        value, n = parts.bound(run).surfaces(parts.times, *parts.states())[k], len(parts)
        visit = of_visit[np.searchsorted(rows, parts.row)]
        inside[visit[high(value, n) <= 0]] = True
        return (~(low(value, n) > 0) & ~inside[visit])[:, None]

    left, _ = undecided(parts_at(run, index, run.problem.program.modes[index].states, rows), decides, HALVINGS)
    inside[of_visit[np.searchsorted(rows, left.row)]] = True
    return [row for row, came_back in zip(entries, inside.tolist(), strict=True) if not came_back]


def _passings(run: RunView, *, walls_alone: bool) -> Iterator[Remark]:
    """Remarks about surfaces that are passed and walls that do not hold, or about walls alone."""
    broken: dict[str, Number] = {}
    for index, _, rows in run.rows_by_mode():
        for first in range(0, len(rows), MOST_PARTS):
            steps = _Steps(run, index, rows[first : first + MOST_PARTS])
            edges = steps.mode.edges
            for k in steps.mode.surfaces:
                if k >= len(edges):
                    wall = wall_of(steps.mode, k)
                    for time in (time for each in _spans(steps, k) for time in _beyond(*each, k)):
                        broken[wall] = min(time, broken.get(wall, time))
                elif not walls_alone and may_be_passed(run.problem.program, edges[k]):
                    times = (time for each in _spans(steps, k) for time in _passed(*each, k))
                    yield from (of_edge("passed", edges[k].name, time) for time in times)
    yield from (Remark("beyond", wall, time) for wall, time in broken.items())


@dataclass(frozen=True)
class _Steps:
    """Steps of a run in one mode, that begin at ``rows``."""

    run: RunView
    index: int
    rows: NDArray[np.int64]

    @property
    def mode(self) -> ModeProgram:
        """The mode."""
        return self.run.problem.program.modes[self.index]

    def at(self, share: Array | float) -> tuple[ModeKernel, list[Range]]:
        """The mode's routines over ranges, and time and states at a share of each step; its end is the row there."""
        execution, rows, n = self.run.execution, self.rows, len(self.mode.states)
        times = np.asarray(execution.times, dtype=float)
        data = [Range(column, column) for column in self.run.data_at(times[rows]).T]
        if np.ndim(share) == 0 and share in (0.0, END):
            states = np.asarray(execution.values[rows + int(share), :n], dtype=float)
        else:
            states, powers = self.run.pieces_at(rows, n)
            moved = np.zeros_like(states)
            for m in reversed(range(powers.shape[1])):
                moved = (moved + powers[:, m]) * np.reshape(share, (-1, 1))
            states = states + moved
        columns = [times[rows] + share * (times[rows + 1] - times[rows]), *states.T]
        return self.run.problem.kernel.enclosing.bind(self.index, data), [Range(column, column) for column in columns]

    def values(self, share: Array | float, k: int) -> Array:
        """Surface k there, between the ends of what round-off makes of it."""
        kernel, point = self.at(share)
        return self._middle(kernel.surfaces(*point)[k])

    def rates(self, share: float, k: int) -> Array:
        """How fast surface k rises there."""
        kernel, point = self.at(share)
        return self._middle(kernel.rates[k](*point)[0])

    def _middle(self, value: Any) -> Array:
        found = as_range(value)
        return np.broadcast_to((found.low + found.high) / 2, len(self.rows))

    def noise(self, share: Array | float, k: int) -> Array:
        """Below this surface k is no more than round-off makes it there, by the largest sizes that states have had."""
        kernel, point = self.at(share)
        sizes = [np.abs(point[0].high), *(self.run.sizes[name] for name in self.mode.states)]
        total = as_range(kernel.magnitudes(*point)[k]).high
        for slope, size in zip(map(as_range, kernel.gradients[k](*point)), sizes, strict=True):
            total = total + np.maximum(np.abs(slope.low), np.abs(slope.high)) * size
        return BEYOND * ROUNDOFF_UNITS * max(float(self.run.arithmetic.unit), FLOAT64.unit) * total

    def sides(self, share: float, k: int) -> Array:
        """On which side of surface k states are: 1 beyond it, -1 inside, 0 on it to round-off or for a tie."""
        late = np.abs(self.rates(share, k)) * 2 * float(self.run.tie(self.run.execution.times[-1]))
        values, noise = self.values(share, k), np.maximum(self.noise(share, k), late)
        return np.where(values > noise, 1.0, np.where(values < -noise, -1.0, 0.0))

    def take(self, which: NDArray[np.bool_]) -> _Steps:
        """Some of the steps."""
        return replace(self, rows=self.rows[which])


def _spans(steps: _Steps, k: int) -> Iterator[tuple[_Steps, float, float]]:
    """Steps with the shares between which they are compared: whole, or in eighths where surface k turns back."""
    turns = (steps.rates(0.0, k) > 0) & (steps.rates(END, k) < 0)
    yield steps.take(~turns), 0.0, END
    if turns.any():
        turning = steps.take(turns)
        yield from ((turning, a, b) for a, b in pairwise(POINTS))


def _passed(steps: _Steps, start: float, end: float, k: int) -> Iterator[Number]:
    """When surface k is passed while its `if` is false; not where a step ends by its own transition."""
    run = steps.run
    steps = steps.take(steps.values(end, k) > 0)
    if not len(steps.rows):
        return
    noise = steps.noise(start, k)
    rising = (steps.values(start, k) <= noise) & (steps.values(end, k) > steps.noise(end, k))
    if end == END:
        rising &= np.array([run.crossed.get(row + 1) != k for row in steps.rows.tolist()])
    steps, noise = steps.take(rising), noise[rising]
    if not len(steps.rows):
        return
    on = steps.values(start, k) >= -noise  # as where the mode was entered
    low, high = np.full(len(steps.rows), start), np.where(on, start, end)
    for _ in range(ROUNDS):
        middle = (low + high) / 2
        below = steps.values(middle, k) <= 0
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    _, point = steps.at(high)
    for t, *x in zip(*(column.low.tolist() for column in point), strict=True):
        with suppress(*DOMAIN_ERRORS):
            if not run.place(steps.index, t, tuple(x)).kernel.conditions[k](t, *x)[0]:
                yield t


def _beyond(steps: _Steps, start: float, end: float, k: int) -> Iterator[Number]:
    """The first time at which wall k does not hold at the beginning or the end of a span."""
    for share in (start, end):
        beyond = steps.take(steps.values(share, k) > 0)
        if len(beyond.rows):
            beyond = beyond.take(beyond.values(share, k) > beyond.noise(share, k))
            yield from beyond.at(share)[1][0].low.tolist()[:1]
