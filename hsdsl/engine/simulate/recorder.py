"""Collects a run's rows as it goes, and makes the execution's columns of them at the end.

The loop appends to plain lists; a run that is interrupted at any moment still closes to a legal execution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from math import inf
from typing import Any, Literal, Protocol

import numpy as np

from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.execution import Arc, Array, Transition
from hsdsl.engine.integrators.stepper import Polynomial, State
from hsdsl.engine.simulate.review import Review

Outputs = Callable[..., State]
FLOAT, DIGITS, TUPLE = 32, 250, 56  # bytes of a number in a list: a float, one of many digits; and of an empty tuple


class OutOfRoom(Exception):
    """The run keeps as many rows as it may."""


@dataclass
class Room:
    """How many more rows a run may keep; it says once that there is none.

    Where ``taken`` of them are ``due`` the recorder reviews the run.
    """

    left: float = inf
    taken: int = 0
    due: float = inf
    look: Callable[[], float] = lambda: inf

    def take(self) -> None:
        """Take a row."""
        if self.taken == self.due:
            self.due = self.look()
        self.taken += 1
        self.left -= 1
        if -1 <= self.left < 0:
            raise OutOfRoom

    @staticmethod
    def of(memory: int, width: int, degree: int, outputs: int, digits: int | None) -> Room:
        """Make room for the rows that fill so many bytes, in lists and in the arrays made of them."""
        numbers = 1 + width * (1 + degree)
        listed = numbers * (FLOAT if digits is None else DIGITS + digits // 2) + TUPLE * (2 + degree)
        return Room(memory // (listed + 8 * (numbers + 1 + outputs)))


class Counted(list[Number]):
    """A list with an element for each row, which takes room."""

    def __init__(self, room: Room, first: Number) -> None:
        super().__init__((first,))
        self._room = room

    def append(self, value: Number) -> None:
        """Add an element."""
        self._room.take()
        super().append(value)


class Progress(Protocol):
    """How far a run is, for another thread to look at."""

    @property
    def now(self) -> Number: ...
    @property
    def until(self) -> Number: ...
    @property
    def made(self) -> int: ...


@dataclass
class OpenArc:
    """An arc being written: its rows are lists that the loop appends to.

    ``scales`` has the scale of each state: the largest size it has had in the run so far.
    """

    mode: str
    states: tuple[str, ...]
    kind: Literal["flow", "strip"]
    jump: int
    outputs: Outputs | None
    times: list[Number]
    values: list[State]
    pieces: list[Polynomial]  # one fewer than rows; none at all where every piece is a straight line
    depths: list[Number] = field(default_factory=list[Number])
    scales: list[Number] = field(default_factory=list[Number])

    def append(self, t: Number, x: State, piece: Polynomial) -> None:
        """Add the piece that leads to a row, and the row."""
        self.times.append(t)
        self.values.append(x)
        self.pieces.append(piece)
        self.notice(x)

    def notice(self, x: State) -> None:
        """Let the scales grow to a state's size."""
        for i, a in enumerate(x):
            self.scales[i] = max(self.scales[i], abs(a))


@dataclass
class Recorder:
    """All arcs and transitions so far, of a run that should last to ``until``."""

    arithmetic: Arithmetic
    until: Number
    degree: int  # of the pieces; 0 for straight lines
    output_count: int
    room: Room = field(default_factory=Room)
    arcs: list[OpenArc] = field(default_factory=list[OpenArc])
    transitions: list[Transition] = field(default_factory=list[Transition])
    scales: dict[str, Number] = field(default_factory=dict[str, Number])  # of states in the arcs before the last
    modes: tuple[str, ...] = ()  # of the model, in order
    review: Review | None = None

    def __post_init__(self) -> None:
        if self.review is not None:
            self.room.due, self.room.look = self.review.due, partial(self._look, self.review)

    def _look(self, review: Review) -> float:
        arc = self.arcs[-1]
        review.look(self.modes.index(arc.mode), arc.times[-1], arc.values[-1])
        return review.due

    @property
    def now(self) -> Number:
        """Time of the last row written."""
        return self.arcs[-1].times[-1] if self.arcs else self.arithmetic.zero

    @property
    def made(self) -> int:
        """How many transitions were made."""
        return len(self.transitions)

    def begin(
        self,
        mode: str,
        states: tuple[str, ...],
        kind: Literal["flow", "strip"],
        outputs: Outputs | None,
        t: Number,
        x: State,
    ) -> OpenArc:
        """Open an arc at its first row."""
        self.room.take()
        if self.arcs:
            self.scales |= zip(self.arcs[-1].states, self.arcs[-1].scales, strict=True)
        scales = [self.scales.get(name, self.arithmetic.zero) for name in states]
        times = Counted(self.room, t)
        arc = OpenArc(mode, states, kind, len(self.transitions), outputs, times, [x], [], scales=scales)
        arc.notice(x)
        self.arcs.append(arc)
        return arc

    def strip(self, arc: OpenArc, rows: list[tuple[Number, Number]], q: State, outputs: Outputs | None) -> None:
        """Write a strip after ``arc``: the state waits at q while the depth grows; rows are (time, depth)."""
        strip = self.begin(arc.mode, arc.states, "strip", outputs, rows[0][0], q)
        for t, _ in rows[1:]:
            strip.append(t, q, ())
        strip.depths = [depth for _, depth in rows]

    def columns(self) -> dict[str, Any]:
        """Build the execution's arrays (see `hsdsl.engine.execution`)."""
        rows = [min(len(a.times), len(a.values), len(a.pieces) + 1 if self.degree else len(a.times)) for a in self.arcs]
        ends = np.cumsum(rows)
        arcs = tuple(
            Arc(a.mode, a.states, a.kind, a.jump, int(end - n), int(end - 1))
            for a, n, end in zip(self.arcs, rows, ends, strict=True)
        )
        width = max(len(a.states) for a in self.arcs)
        total = int(ends[-1])
        nan = self.arithmetic.functions["nan"]
        times, depth = self._filled((total,), self.arithmetic.zero), self._filled((total,), self.arithmetic.zero)
        values = self._filled((total, width), nan)
        outputs = self._filled((total, self.output_count), nan)
        coefficients = self._filled((total, self.degree, width), self.arithmetic.zero)
        for arc, opened, n in zip(arcs, self.arcs, rows, strict=True):
            here = slice(arc.first, arc.last + 1)
            d = len(arc.states)
            times[here] = opened.times[:n]
            if d:
                values[here, :d] = opened.values[:n]
            if opened.depths:
                depth[here] = opened.depths[:n]
            if self.output_count:
                outputs[here] = [self._outputs(opened, k) for k in range(n)]
            if self.degree and d and arc.kind == "flow" and n > 1:
                coefficients[arc.first : arc.last, :, :d] = [self._padded(p, d) for p in opened.pieces[: n - 1]]
        return {
            "times": times,
            "values": values,
            "outputs": outputs,
            "depth": depth,
            "coefficients": coefficients,
            "arcs": arcs,
        }

    def _filled(self, shape: tuple[int, ...], value: Number) -> Array:
        if self.arithmetic.name == "float64":
            return np.full(shape, value, dtype=np.float64)
        return np.full(shape, value, dtype=object)

    def _padded(self, piece: Polynomial, dimension: int) -> Polynomial:
        """Fill up a piece of lower degree (a secant where the flow beyond a guard has no value)."""
        missing = self.degree - len(piece)
        return (*piece, *((self.arithmetic.zero,) * dimension for _ in range(missing))) if missing else piece

    def _outputs(self, arc: OpenArc, k: int) -> State:
        return arc.outputs(arc.times[k], *arc.values[k]) if arc.outputs else self._no_outputs

    @property
    def _no_outputs(self) -> State:
        return (self.arithmetic.functions["nan"],) * self.output_count
