"""Work and precision: the time that each method, scheme, engine and peer needs for an error, and its wrong results.

`work_precision` runs everything that can run a model at several tolerances (adaptive methods) or steps (fixed ones),
warm and in turns, and compares each result with the model's exact execution.

==============  ============================================================================================
`scene`         a model with its numbers, its exact execution, and when errors are taken; results of tools there
`plan`          the runs: our own and those of peers
`outcome`       the error of a result, whether it is the right execution, and what came of a run in one word
`stopwatch`     warm times, in turns
`rows`          rows as text and as CSV; `picture` draws them
`peers`         other tools, each run as its own documentation shows
`translation`   a model's mathematics as functions for another tool, and the loop around one that stops at events
`stability`     maps of outcomes over a plane of settings and numbers
==============  ============================================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan

from hsdsl.interface.chart.outcome import Judgement, judge, rho
from hsdsl.interface.chart.peers import PEERS
from hsdsl.interface.chart.plan import ENGINES, OWN_SCHEMES, TOLERANCES, own_runs, peer_runs
from hsdsl.interface.chart.rows import Row
from hsdsl.interface.chart.scene import Attempt, Refused, Result, Scene
from hsdsl.interface.chart.stopwatch import Deadline, race

__all__ = ["ENGINES", "OWN_SCHEMES", "PEERS", "TOLERANCES", "Judgement", "Refused", "Row", "Scene", "work_precision"]


def work_precision(
    scene: Scene,
    *,
    schemes: Sequence[str] = OWN_SCHEMES,
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
    """Run a scene with our methods and peers.

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
        Seconds; a run that takes longer is ended, and the same tool at tighter settings is left out. A search for rho
        has half of that time, and is ended after all of it.
    with_rho : bool
        Also compute rho (of our own runs; a peer's samples are no execution).
    watch : callable
        Called with the name of the next run.

    Returns
    -------
    rows, remarks
        The results, and sentences on what was left out and why.
    """
    remarks: list[str] = []
    attempts = list(own_runs(scene, schemes, methods, engines, tolerances, steps, remarks))
    for name in against:
        attempts += peer_runs(scene, name, tolerances, remarks)

    def judged(attempt: Attempt, result: Result | None) -> Judgement:
        if result is None or result.interrupted:
            return Judgement("failed", nan, None, f"no end within {patience:g} s")
        judgement = judge(scene, result)
        if with_rho and result.execution is not None:
            watch(f"rho of {attempt.tool.label} {attempt.setting}")
            with Deadline(patience):  # the search itself looks at the time between its parts only
                judgement = judgement._replace(rho=rho(scene, result.execution, patience / 2))
        return judgement

    done = race(attempts, judged, rounds, patience, watch)
    return [Row(scene.name, attempt, judgement, timed) for attempt, judgement, timed in done], remarks
