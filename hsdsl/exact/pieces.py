"""A closed form as an execution: each stretch between jumps becomes polynomial pieces of a known error.

The values at both sides of a jump are the formula's, rounded once. Time between two stretches is spent in a strip: with
gaps of epsilon the result is a relaxed execution (Fig. 10).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Protocol

import numpy as np

from hsdsl.errors import UsageError
from hsdsl.exact.interpolation import breakpoints, coefficients, error_of
from hsdsl.exact.numbers import Number, Vector
from hsdsl.exact.scene import Scene, Stretch
from hsdsl.execution import Arc, Array, Execution, Kind, Point, Stop, Transition
from hsdsl.program import Program


class Lowered(Protocol):
    """A model, as far as an exact execution needs one."""

    @property
    def program(self) -> Program: ...


@dataclass
class _Columns:
    """Rows, arcs and transitions as they are filled in, and the largest error so far."""

    states: Mapping[str, tuple[str, ...]]
    degree: int
    times: list[float] = field(default_factory=list[float])
    values: list[list[float]] = field(default_factory=list[list[float]])
    coefficients: list[Array] = field(default_factory=list[Array])
    arcs: list[Arc] = field(default_factory=list[Arc])
    depth: dict[int, float] = field(default_factory=dict[int, float])  # by row, where it is not 0
    transitions: list[Transition] = field(default_factory=list[Transition])
    error: float = 0.0

    def add(self, stretch: Stretch) -> None:
        """Add a stretch as an arc."""
        first = len(self.times)
        cuts = breakpoints(stretch, self.degree)
        for begin, end in pairwise(cuts):
            x = stretch.first if begin is stretch.start else self._at(stretch, begin)
            piece = coefficients(stretch, begin, end, self.degree)
            self._row(float(begin), x, piece)
            self.error = max(self.error, error_of(stretch, begin, end, x, piece))
        self._row(float(stretch.end), stretch.last)
        self._arc(stretch.mode, "flow", first)

    def _at(self, stretch: Stretch, t: Number) -> Vector:
        assert stretch.at is not None
        return stretch.at(t)

    def _row(self, t: float, x: Vector, piece: Array | None = None) -> None:
        width = max(map(len, self.states.values()))
        padded = np.zeros((self.degree, width))
        if piece is not None:
            padded[:, : len(x)] = piece
        self.times.append(t)
        self.values.append([*map(float, x), *[np.nan] * (width - len(x))])
        self.coefficients.append(padded)

    def _arc(self, mode: str, kind: Kind, first: int) -> None:
        self.arcs.append(Arc(mode, self.states[mode], kind, len(self.transitions), first, len(self.times) - 1))

    def jump(self, before: Stretch, mode: str, start: Number, x: Vector) -> None:
        """Add the transition that ends a stretch, if there is one, and a strip before what begins at ``start``."""
        if before.edge is None:
            return
        t, resumed = float(before.end), float(start)
        if resumed > t:
            self._row(t, before.last)
            self.depth[len(self.times)] = resumed - t
            self._row(resumed, before.last)
            self._arc(before.mode, "strip", len(self.times) - 2)
        values = ((before.mode, before.last), (mode, x))
        sides = [dict(zip(self.states[name], map(float, side), strict=True)) for name, side in values]
        self.transitions.append(
            Transition(
                index=len(self.transitions),
                time=t,
                resumed=resumed,
                edge=before.edge,
                source=before.mode,
                target=mode,
                before=sides[0],
                after=sides[1],
                alternatives=before.alternatives,
            )
        )

    def enter(self, before: Stretch, final: str) -> None:
        """End with the entry of a final mode."""
        self.jump(before, final, before.end, before.last)
        self._row(float(before.end), before.last)
        self._arc(final, "flow", len(self.times) - 1)


def as_execution(scene: Scene, of: Lowered | None) -> Execution:
    """Cut a scene into pieces.

    Raises
    ------
    UsageError
        ``of`` has other modes or states than the scene.
    """
    columns = _Columns(scene.states, scene.degree)
    for k, stretch in enumerate(scene.stretches):
        if k:
            columns.jump(scene.stretches[k - 1], stretch.mode, stretch.start, stretch.first)
        columns.add(stretch)
    if scene.final is not None:
        columns.enter(scene.stretches[-1], scene.final)
    path, digest = _identity(scene, of)
    depth = np.zeros(len(columns.times))
    depth[list(columns.depth)] = list(columns.depth.values())
    values, until, last = np.array(columns.values), columns.times[-1], columns.arcs[-1]
    return Execution(
        model=path,
        digest=digest,
        engine=scene.method,
        scheme="exact",
        method=scene.method,
        settings={"until": until, "error": columns.error, "digits": scene.digits, "source": scene.source},
        stop=_stop(scene, until),
        transitions=tuple(columns.transitions),
        final=Point(until, last.mode, last.jump, "flow", dict(zip(last.states, values[-1].tolist(), strict=False)), {}),
        verdict=scene.verdict,
        output_names=(),
        times=np.array(columns.times),
        values=values,
        outputs=np.empty((len(values), 0)),
        depth=depth,
        coefficients=np.array(columns.coefficients),
        arcs=tuple(columns.arcs),
        seconds={},
        title=scene.title,
    )


def _stop(scene: Scene, until: float) -> Stop:
    if scene.final is not None:
        return Stop("final", until, f"entered final mode {scene.final} at t = {until:.10g}")
    return Stop("until", until, f"reached t = {until:.10g}")


def _identity(scene: Scene, of: Lowered | None) -> tuple[str, str]:
    if of is None:
        return scene.name, ""
    program = of.program
    modes = {mode.name: mode.states for mode in program.modes}
    for mode in dict.fromkeys(stretch.mode for stretch in scene.stretches):
        if modes.get(mode) != scene.states[mode]:
            raise UsageError(
                f"{program.path} is not the model of '{scene.title}': it has no mode {mode} "
                f"with the states {', '.join(scene.states[mode])}"
            )
    return program.path, program.digest
