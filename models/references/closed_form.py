"""Closed forms as executions: each stretch between jumps becomes polynomial pieces with a bound on their error.

The one-sided values at a jump are the formula's, rounded once. Time between two stretches is spent in a strip: with
gaps of epsilon the result is a relaxed execution (Fig. 10).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from hsdsl.engine.execution import Arc, Array, Execution, Kind, Point, Stop, Transition, Verdict
from references.interpolation import DIGITS, Number, Stretch, Vector, breakpoints, coefficients, error_of


@dataclass(frozen=True)
class ClosedForm:
    """An exact execution before it is cut into pieces.

    Attributes
    ----------
    name : str
        The model's file.
    states : mapping
        The states of each mode, in the model's order.
    degree : int
        Of the pieces; 0 for an execution that is straight everywhere.
    final : str or None
        The final mode that ends it; its states are those of the last stretch.
    """

    name: str
    title: str
    source: str
    states: Mapping[str, tuple[str, ...]]
    stretches: Sequence[Stretch]
    verdict: Verdict
    degree: int
    method: str = "closed form"
    digits: int = DIGITS
    final: str | None = None


@dataclass
class _Columns:
    """Rows, arcs and transitions as they are filled in, and the largest error so far."""

    states: Mapping[str, tuple[str, ...]]
    degree: int
    times: list[float] = field(default_factory=list[float])
    values: list[list[float]] = field(default_factory=list[list[float]])
    coefficients: list[Array] = field(default_factory=list[Array])
    arcs: list[Arc] = field(default_factory=list[Arc])
    depth: list[float] = field(default_factory=list[float])
    transitions: list[Transition] = field(default_factory=list[Transition])
    error: float = 0.0

    def add(self, stretch: Stretch) -> None:
        """Add a stretch as an arc."""
        first = len(self.times)
        for begin, end in pairwise(breakpoints(stretch, self.degree)):
            x = stretch.at(begin) if stretch.at and begin is not stretch.start else stretch.first
            piece = coefficients(stretch, begin, end, self.degree)
            self._row(float(begin), x, piece)
            self.error = max(self.error, error_of(stretch, begin, end, x, piece))
        self._row(float(stretch.end), stretch.last)
        self._arc(stretch.mode, "flow", first)

    def _row(self, t: float, x: Vector, piece: Array | None = None, depth: float = 0.0) -> None:
        width = max(map(len, self.states.values()))
        padded = np.zeros((self.degree, width))
        if piece is not None:
            padded[:, : len(x)] = piece
        self.times.append(t)
        self.values.append([*map(float, x), *[np.nan] * (width - len(x))])
        self.coefficients.append(padded)
        self.depth.append(depth)

    def _arc(self, mode: str, kind: Kind, first: int) -> None:
        self.arcs.append(Arc(mode, self.states[mode], kind, len(self.transitions), first, len(self.times) - 1))

    def jump(self, before: Stretch, mode: str, start: Number, x: Vector) -> None:
        """Add the transition that ends a stretch, if there is one, and a strip before what begins at ``start``."""
        if before.edge is None:
            return
        t, resumed = float(before.end), float(start)
        if resumed > t:
            self._row(t, before.last)
            self._row(resumed, before.last, depth=resumed - t)
            self._arc(before.mode, "strip", len(self.times) - 2)
        self.transitions.append(
            Transition(
                index=len(self.transitions),
                time=t,
                resumed=resumed,
                edge=before.edge,
                source=before.mode,
                target=mode,
                before=self._named(before.mode, before.last),
                after=self._named(mode, x),
                alternatives=before.alternatives,
            )
        )

    def _named(self, mode: str, x: Vector) -> dict[str, float]:
        return dict(zip(self.states[mode], map(float, x), strict=True))

    def enter(self, before: Stretch, final: str) -> None:
        """End with the entry of a final mode."""
        self.jump(before, final, before.end, before.last)
        self._row(float(before.end), before.last)
        self._arc(final, "flow", len(self.times) - 1)


def as_execution(form: ClosedForm) -> Execution:
    """Cut a closed form into pieces; ``settings["error"]`` bounds the error at any time."""
    columns = _Columns(form.states, form.degree)
    for k, stretch in enumerate(form.stretches):
        if k:
            columns.jump(form.stretches[k - 1], stretch.mode, stretch.start, stretch.first)
        columns.add(stretch)
    if form.final is not None:
        columns.enter(form.stretches[-1], form.final)
    values, until, last = np.array(columns.values), columns.times[-1], columns.arcs[-1]
    return Execution(
        model=form.name,
        digest="",
        engine=form.method,
        scheme="exact",
        method=form.method,
        settings={"until": until, "error": columns.error, "digits": form.digits, "source": form.source},
        stop=Stop("final", until, f"entered final mode {form.final} at t = {until:.10g}")
        if form.final is not None
        else Stop("until", until, f"reached t = {until:.10g}"),
        transitions=tuple(columns.transitions),
        final=Point(until, last.mode, last.jump, "flow", dict(zip(last.states, values[-1].tolist(), strict=False)), {}),
        verdict=form.verdict,
        output_names=(),
        times=np.array(columns.times),
        values=values,
        outputs=np.empty((len(values), 0)),
        depth=np.array(columns.depth),
        coefficients=np.array(columns.coefficients),
        arcs=tuple(columns.arcs),
        seconds={},
        title=form.title,
    )
