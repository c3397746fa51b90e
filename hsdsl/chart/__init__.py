"""Speed against accuracy: what each method, scheme, engine and peer needs for which error, and where each goes wrong.

`work_precision` runs everything that can run a model at several tolerances (adaptive methods) or steps (fixed ones),
warm and in turns, and holds each result against the model's exact execution.

==============  ============================================================================================
`scene`         a model with its numbers, its exact execution, and the times at which errors are taken
`plan`          which runs of our own to make
`judge`         the error of a result, and whether it is the right execution at all
`stopwatch`     warm times, in turns
`peers`         other tools, each run as its own documentation shows
`translation`   a model's mathematics as functions for another tool
`by_arcs`       the loop around a tool that stops at events
==============  ============================================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from hsdsl.chart.judge import Judgement, judge, rho
from hsdsl.chart.peers import PEERS, prepare
from hsdsl.chart.plan import ENGINES, SCHEMES, own_runs
from hsdsl.chart.result import Attempt, Refused, Result
from hsdsl.chart.scene import Scene
from hsdsl.chart.stopwatch import Timed, race

__all__ = ["ENGINES", "PEERS", "SCHEMES", "TOLERANCES", "Judgement", "Refused", "Row", "Scene", "work_precision"]

TOLERANCES = tuple(10.0**-k for k in range(3, 13))


@dataclass(frozen=True)
class Row:
    """One run of one tool: what it was asked, what it took, how right it was.

    ``seconds`` is the median of warm runs, sampling included, NaN where none was finished.
    """

    model: str
    attempt: Attempt
    judgement: Judgement
    timed: Timed

    @property
    def seconds(self) -> float:
        """Median seconds of a warm run."""
        return self.timed.median


def work_precision(
    scene: Scene,
    *,
    schemes: Sequence[str] = SCHEMES,
    methods: Sequence[str] = (),
    engines: Sequence[str] = ENGINES,
    tolerances: Sequence[float] = TOLERANCES,
    steps: Sequence[float] = (),
    against: Sequence[str] = (),
    rounds: int = 5,
    patience: float = 10.0,
    with_rho: bool = True,
    watch: Callable[[str], None] = lambda _: None,
) -> tuple[list[Row], list[str]]:
    """Run a scene with everything asked for.

    Parameters
    ----------
    scene : Scene
        See :meth:`Scene.of`.
    schemes, methods, engines : sequence of str
        Ours; all methods that a scheme and an engine serve unless given.
    tolerances, steps : sequence of float
        For adaptive and for fixed-step methods; steps left out are fractions of the run, 1e-3 to 1e-5.
    against : sequence of str
        Names of :data:`PEERS`.
    rounds : int
        Timed turns; one before them warms everything and is judged.
    patience : float
        Seconds; a run that takes longer is timed once, and the same tool at tighter settings is left out.
    with_rho : bool
        Also compute rho (of our own runs; a peer's samples are no execution).
    watch : callable
        Told what is about to run.

    Returns
    -------
    rows, remarks
        The results, and sentences on what was left out and why.
    """
    remarks: list[str] = []
    attempts = list(_attempts(scene, schemes, methods, engines, tolerances, steps, against, remarks))

    def judged(attempt: Attempt, result: Result) -> Judgement:
        judgement = judge(scene, result)
        if with_rho and result.execution is not None:
            watch(f"rho of {attempt.label} {attempt.setting}")
            judgement = judgement.with_rho(rho(scene, result.execution))
        return judgement

    done = race(attempts, judged, rounds, patience, watch)
    return [Row(scene.name, attempt, judgement, timed) for attempt, judgement, timed in done], remarks


def _attempts(
    scene: Scene,
    schemes: Sequence[str],
    methods: Sequence[str],
    engines: Sequence[str],
    tolerances: Sequence[float],
    steps: Sequence[float],
    against: Sequence[str],
    remarks: list[str],
) -> Iterator[Attempt]:
    yield from own_runs(scene, schemes, methods, engines, tolerances, steps, remarks)
    for name in against:
        try:
            run: Callable[[float], Result] = prepare(name, scene)
        except Refused as refusal:
            remarks.append(f"{name}: {refusal}")
            continue
        for tolerance in tolerances:
            yield Attempt(name, "", "", "tolerance", tolerance, partial(_sized, run, tolerance))


def _sized(run: Callable[[float], Any], tolerance: float) -> Any:
    return run(tolerance)
