# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""The columns of a sweep's dataset, and an ensemble as a table of them.

======================================= =======================================================================
``row``                                 the number of the run
a varied name                           its value; ``parameter.stop`` for a parameter with the name of a column
``stop``, ``message``                   why it ended, a sentence where it did not get to where it was going
``verdict``                             whether the theorem holds; null where that was not looked at
``warnings``                            codes of `errors.WARNINGS`, with a space between two: what the run itself
                                        noted, and with verdicts all of its warnings, but for those of the file alone
``time``, ``mode``, ``transitions``     when and where it ended, and how many transitions it made
``final.x``                             states and outputs at the end
``transition.time``, ``.name``          lists: every transition, and the states ``before.x`` and ``after.x``
``sample.time``, ``sample.x``           lists: states and outputs at sample times
``verdict.reasons``                     a list: the reasons of the verdict
======================================= =======================================================================

A number that there is not (a state that the mode lacks, a run that was refused) is null.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from hsdsl.analysis.sweep.manifest import Manifest
from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.engine.execution import LEFT, Array, Ensemble
from hsdsl.engine.execution.records import optional
from hsdsl.engine.simulate.stops import limit

FIXED = ("row", "stop", "message", "verdict", "warnings", "time", "mode", "transitions")
TAG = b"hsdsl.sweep"
LISTS = ("transition", "before", "after", "sample")


def column_of(name: str) -> str:
    """The column of a varied name."""
    return f"parameter.{name}" if name in FIXED else name


def library(module: str = "pyarrow") -> Any:
    """Import pyarrow."""
    return optional(module, "a sweep", "sweep")


def schema(manifest: Manifest) -> Any:
    """The columns of a dataset."""
    arrow = library()
    number, text, recording = arrow.float64(), arrow.string(), manifest.recording
    columns: list[tuple[str, Any]] = [("row", arrow.int64())]
    columns += [(column_of(name), number) for name in manifest.variation.names]
    columns += [("stop", text), ("message", text), ("verdict", text)]
    columns += [("warnings", text)] if recording.warnings else []
    columns += [("time", number), ("mode", text)]
    columns += [("transitions", arrow.int64())]
    names = (*manifest.states, *manifest.outputs)
    if recording.final:
        columns += [(f"final.{name}", number) for name in names]
    if recording.transitions:
        columns += [("transition.time", arrow.list_(number)), ("transition.name", arrow.list_(text))]
        around = ("before", "after")
        columns += [(f"{side}.{name}", arrow.list_(number)) for side in around for name in manifest.states]
    if recording.samples is not None:
        columns += [(f"sample.{name}", arrow.list_(number)) for name in dict.fromkeys(("time", *names))]
    if recording.verdict:
        columns += [("verdict.reasons", arrow.list_(text))]
    return arrow.schema(columns, metadata={TAG: manifest.tag.encode()})


def table(manifest: Manifest, first: int, ensemble: Ensemble) -> Any:
    """The rows of an ensemble, the first of which has the number ``first``."""
    arrow, columns = library(), schema(manifest)
    values = dict(_columns(manifest, first, ensemble))
    arrays = [
        _lists(arrow, values[field.name], field.type) if field.name.partition(".")[0] in LISTS
        else arrow.array(values[field.name], type=field.type, from_pandas=True)
        for field in columns
    ]  # fmt: skip
    return arrow.table(arrays, schema=columns)


def refused(manifest: Manifest, first: int, last: int, why: str) -> Any:
    """Rows that could not be run at all."""
    arrow, columns = library(), schema(manifest)
    count, values = last - first, manifest.variation.values(first, last)
    known: dict[str, Any] = {"row": np.arange(first, last), "transitions": np.zeros(count, int)}
    known |= {"stop": np.full(count, "refused"), "message": np.full(count, why), "mode": np.full(count, "")}
    known |= {column_of(name): column for name, column in values.items()}
    arrays = [
        arrow.array(known[field.name], type=field.type) if field.name in known else arrow.nulls(count, field.type)
        for field in columns
    ]
    return arrow.table(arrays, schema=columns)


def _columns(manifest: Manifest, first: int, ensemble: Ensemble) -> Iterator[tuple[str, Any]]:
    count = ensemble.stop.size
    yield "row", np.arange(first, first + count)
    yield from ((column_of(name), column) for name, column in manifest.variation.values(first, first + count).items())
    yield "stop", ensemble.stop
    yield from _words(manifest, ensemble)
    yield "time", ensemble.time
    yield "mode", ensemble.mode
    yield "transitions", ensemble.transitions
    yield from ((f"final.{name}", column) for name, column in (ensemble.state | ensemble.outputs).items())
    made = ensemble.transition_table
    if made is not None:
        yield "transition.time", (made.first, made.time)
        yield "transition.name", (made.first, made.edge)
        for side, states in (("before", made.before), ("after", made.after)):
            yield from ((f"{side}.{name}", (made.first, column)) for name, column in states.items())
    yield from ((f"sample.{name}", column) for name, column in _samples(ensemble).items())


def _samples(ensemble: Ensemble) -> dict[str, tuple[Array, Array]]:
    """Samples up to the end of each run, one behind the other."""
    times = ensemble.sample_times
    with np.errstate(invalid="ignore"):
        inside = times <= (ensemble.time * (1 + TIE))[:, None]
    first = np.concatenate([[0], np.cumsum(inside.sum(axis=1))])
    columns = ensemble.samples | {"time": times}
    return {name: (first, column[inside]) for name, column in columns.items()}


def _words(manifest: Manifest, ensemble: Ensemble) -> Iterator[tuple[str, Any]]:
    """Messages of failures, and verdicts."""
    count, judged = ensemble.stop.size, manifest.recording.verdict
    messages, verdicts, reasons = (np.full(count, None, object) for _ in range(3))
    warnings = ensemble.warnings.astype(object)
    warnings[np.isin(ensemble.stop, ("refused", "interrupted"))] = None
    verdicts[np.isin(ensemble.stop, LEFT)] = "left"
    for k in range(count) if judged else np.flatnonzero(ensemble.failed).tolist():
        reason = str(ensemble.stop[k])
        if reason == "refused":
            messages[k] = ensemble.refusals[(k,)]
        elif reason == "transition_limit" and not judged:
            messages[k] = limit(int(ensemble.transitions[k]), float(ensemble.time[k])).message
        else:
            run = ensemble.run(k)
            messages[k] = None if run.stop.complete else run.stop.message
            if judged:
                verdicts[k], reasons[k] = run.verdict.theorem, run.verdict.reasons
                warnings[k] = " ".join(sorted({each.code for each in run.warnings if each.time is not None}))
    yield "message", messages
    yield "verdict", verdicts
    yield "warnings", warnings
    yield "verdict.reasons", reasons


def _lists(arrow: Any, column: tuple[Array, Array], kind: Any) -> Any:
    first, values = column
    inner = arrow.array(values, type=kind.value_type, from_pandas=True)
    return arrow.ListArray.from_arrays(arrow.array(first, type=arrow.int32()), inner)
