"""What a module for JAX has no rule for: a model that needs it is refused, at the place that asks for it."""

from __future__ import annotations

from hsdsl.base.errors import Diagnostic, ModelError
from hsdsl.export.automata import document_of
from hsdsl.export.source import Source
from hsdsl.mathematics.program import ModeProgram, Queue

LACKING = "HS341"


def check(source: Source) -> None:
    """Refuse events of which several executions may wait: what waits are states here, and there are those of one.

    Raises ModelError: the first such event.
    """
    for mode in source.problem.program.modes:
        for queue in mode.queues:
            if queue.most > 1:
                raise ModelError([_refused(source, mode, queue)])


def _refused(source: Source, mode: ModeProgram, queue: Queue) -> Diagnostic:
    name = queue.name.rpartition("@")[0]
    message = f"jax keeps one execution of '{name}' that waits: expected `waiting: 1`, got {queue.most}"
    hint = "with `waiting: 1` a second one ends a run, with `waiting_limit`; other targets keep several"
    if source.model.pipeline.files is None:
        return Diagnostic(LACKING, message, None, hint)
    written = next(m for key, m in document_of(source).modes.items() if str(key) == mode.name)
    places = [t.delay.place for t in written.transitions if t.delay is not None and t.waiting == queue.most]
    named = [t.delay.place for t in written.transitions if t.delay and t.name and t.name.value == name]
    return (named or places)[0].diagnostic(LACKING, message, hint)
