"""Executions of systems of parts as their readers see them: product modes by name, each with its own states.

A run of such a system is one mode with the numbers of its parts' modes among its states (`parts`). What is shown
lacks these numbers, and states that the mode of their part does not have.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.base.parts import Part, numbered, numbers_of, present, product_name
from hsdsl.engine.execution import Arc, Array, Execution, Point, Stop, Transition, Verdict
from hsdsl.engine.execution.records import Records
from hsdsl.engine.simulate import Prepared

_AS_THEY_ARE = ("model", "digest", "engine", "scheme", "method", "output_names", "seconds", "digits", "title",
                "overrides")  # fmt: skip


def visible_run(run: Execution, prepared: Prepared) -> Execution:
    """What a run of a system of parts shows; the run itself where there are no parts."""
    if not prepared.program.parts:
        return run
    view, own = _View(run, prepared), run.noted
    noted: Callable[[Any], str] | None = None if own is None else lambda _: own(run)
    later: dict[str, Callable[[Any], Any]] = {
        "settings": lambda _: run.settings,
        "times": lambda _: run.times,
        "outputs": lambda _: run.outputs,
        "depth": lambda _: run.depth,
        "values": lambda _: view.of_states(run.values),
        "coefficients": lambda _: view.of_states(run.coefficients),
        "arcs": lambda _: view.arcs,
        "transitions": lambda _: view.transitions,
        "final": lambda _: view.final,
        "verdict": lambda _: run.verdict,
    }
    return Execution.deferred(
        later,
        prepared.links,
        **{name: getattr(run, name) for name in _AS_THEY_ARE},
        stop=view.stop,
        output_function=None if run.output_function is None else view.output_values,
        assessment=view.assessment,
        repetition=view.repetition,
        noted=noted,
        sampler=None,
    )


def with_output_function(run: Execution, prepared: Prepared) -> Execution:
    """A run as it was shown, with the function that gives its outputs between rows."""
    function = prepared.output_values
    if prepared.program.parts:
        function = _View(replace(run, output_function=function), prepared).output_values
    return replace(run, output_function=function)


class _View:
    """A run, and the product mode of each of its arcs."""

    def __init__(self, run: Execution, prepared: Prepared) -> None:
        self.run, self.prepared = run, prepared
        self.parts: tuple[Part, ...] = prepared.program.parts
        self.hidden = frozenset(numbered(self.parts))
        self._known: dict[tuple[int, ...], tuple[str, frozenset[str]]] = {}

    def assessment(self, _: Execution, estimated: bool) -> Verdict:
        """The verdict of the run itself."""
        return self.run.estimated().verdict if estimated else self.run.verdict

    def repetition(self, _: Execution) -> Execution:
        """The same run, finer."""
        return visible_run(self.prepared.again(self.run), self.prepared)

    def product(self, state: Mapping[str, Any]) -> tuple[str, frozenset[str]]:
        """The name of a product mode, and its states."""
        key = tuple(part.number(state) for part in self.parts)
        if key not in self._known:
            self._known[key] = product_name(self.parts, state), present(self.parts, state)
        return self._known[key]

    def shown(self, state: Mapping[str, Any]) -> dict[str, Any]:
        """The states that a reader sees."""
        own = self.product(state)[1]
        return {name: value for name, value in state.items() if name in own}

    @cached_property
    def arcs(self) -> tuple[Arc, ...]:
        """The arcs by their product modes."""
        return tuple(arc for arc, _ in self._arcs)

    @cached_property
    def _arcs(self) -> list[tuple[Arc, tuple[int, ...]]]:
        """Each arc with the columns of its states among those of the run."""
        found: list[tuple[Arc, tuple[int, ...]]] = []
        made: dict[tuple[Any, ...], tuple[str, tuple[int, ...], tuple[str, ...]]] = {}
        for arc in self.run.arcs:
            places = {name: k for k, name in enumerate(arc.states) if name in self.hidden}
            row = self.run.values[arc.first]
            key = (arc.states, *(row[k] for k in places.values()))
            if key not in made:
                mode, own = self.product({name: row[k] for name, k in places.items()})
                columns = tuple(k for k, name in enumerate(arc.states) if name in own)
                made[key] = mode, columns, tuple(arc.states[k] for k in columns)
            mode, columns, states = made[key]
            found.append((replace(arc, mode=mode, states=states), columns))
        return found

    def of_states(self, whole: Array) -> Array:
        """The columns of a run's states that a reader sees; each arc begins at the first."""
        kinds = {columns for _, columns in self._arcs}
        if len(kinds) == 1:
            return np.ascontiguousarray(whole[..., list(kinds.pop())])
        width = max(map(len, kinds))
        filler = np.nan if whole.ndim == 2 else 0.0
        seen = np.full((*whole.shape[:-1], width), filler, dtype=whole.dtype)
        for arc, columns in self._arcs:
            seen[arc.first : arc.last + 1, ..., : len(columns)] = whole[arc.first : arc.last + 1][..., list(columns)]
        return seen

    @cached_property
    def transitions(self) -> Sequence[Transition]:
        """The transitions between product modes."""
        own = self.run.transitions
        return Records(len(own), lambda start, end: map(self._transition, own[start:end]))

    def _transition(self, made: Transition) -> Transition:
        after = made.after if made.after is not None else self._landing(made)
        return replace(
            made,
            source=self.product(made.before)[0],
            target=self.product(after)[0],
            before=self.shown(made.before),
            after=None if made.after is None else self.shown(made.after),
        )

    def _landing(self, made: Transition) -> dict[str, Any]:
        """Where a transition leads in whose strip the run ended."""
        mode = self.prepared.program.modes[0]
        kernel = self.prepared.kernel.bind(0, self.prepared.timeline.at(made.time).data)
        x = tuple(made.before[name] for name in mode.states)
        values = kernel.surfaces(made.time, *x)
        named = [k for k, edge in enumerate(mode.edges) if edge.name == made.edge]
        k = min(named, key=lambda k: abs(values[k]))
        return dict(zip(mode.edges[k].target_states, kernel.resets[k](made.time, *x), strict=True))

    @property
    def stop(self) -> Stop:
        """Why the run ended, with the name of the product mode that it ended in."""
        stop = self.run.stop
        for mode in self.prepared.program.modes:
            if f"mode {mode.name}" in stop.message:
                return replace(stop, message=stop.message.replace(f"mode {mode.name}", f"mode {self.final.mode}"))
        return stop

    @cached_property
    def final(self) -> Point:
        """The last point."""
        point = self.run.final
        return replace(point, mode=self.product(point.state)[0], state=self.shown(point.state))

    def output_values(self, mode: str, t: Number, x: tuple[Number, ...]) -> Any:
        """The outputs at a state of a product mode."""
        states = self.prepared.program.modes[0].states
        numbers = numbers_of(self.parts, mode)
        own = present(self.parts, numbers)
        known = dict(zip((name for name in states if name in own), x, strict=True))
        zero = self.prepared.arithmetic.zero
        whole = tuple(known.get(name, zero + numbers.get(name, 0)) for name in states)
        assert self.run.output_function is not None
        return self.run.output_function(self.prepared.program.modes[0].name, t, whole)
