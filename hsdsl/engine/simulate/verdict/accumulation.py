"""Zeno points and rest: where a relaxed run goes through more transitions than the theorem is about.

The relaxed scheme goes on behind a Zeno point and creeps along a guard where the execution rests or slides. Either way
many transitions follow each other with hardly any flow between them.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import accumulate, pairwise

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.simulate.stops import FREE, show
from hsdsl.engine.simulate.verdict.run_view import RunView


def slidings(run: RunView) -> Iterator[str]:
    """Say where the run slid on a surface that two modes press on: the theorem knows no such motion."""
    for modes, start, end in sliding_spans(run):
        yield f"sliding between {' and '.join(modes)} from t = {show(start)} to t = {show(end)}"


def sliding_spans(run: RunView) -> Iterator[tuple[tuple[str, ...], Number, Number]]:
    """Give the modes between which the run slid, and from when to when."""
    modes = {mode.name: mode.slides for mode in run.problem.program.modes if mode.slides}
    spans: list[tuple[str, Number, Number]] = []
    for arc in run.flows if modes else ():
        if arc.mode in modes:
            start, end = run.times[arc.first], run.times[arc.last]
            if spans and spans[-1][::2] == (arc.mode, start):  # a jump or a kink of an input ended the arc before
                start = spans.pop()[1]
            spans.append((arc.mode, start, end))
    yield from ((modes[mode], start, end) for mode, start, end in spans)


def accumulations(run: RunView) -> Iterator[str]:
    """Say where transitions first crowd together, and where they are last seen to."""
    relaxation, made = run.problem.settings.relaxation, run.transitions
    if len(made) <= FREE:
        return
    flights = [b.time - (a.resumed if a.resumed is not None else a.time) for a, b in pairwise(made)]
    flown = [run.arithmetic.zero, *accumulate(flights)]
    crowded = [k for k in range(FREE, len(made)) if flown[k] - flown[k - FREE] <= relaxation]
    if crowded:
        first = made[crowded[0] - FREE]
        yield (
            f"more than {FREE} transitions within the relaxation of flow from t = {show(first.time)} on "
            f"({first.edge}): a Zeno point, rest or sliding, which the theorem is not about"
        )
