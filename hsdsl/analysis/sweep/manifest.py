# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""The manifest of a sweep's dataset, as JSON in ``_sweep.json``, and its columns, which an ensemble fills.

Readers of Parquet skip files whose names begin with an underscore. How a run ended is always kept; the rest on request:

======================= ==============================================================================
``final``               states and outputs at the end
``transitions``         every transition: time, name, states before and after, as lists
``outputs:every=0.1``   states and outputs at the multiples of a time, an expression of parameters
``outputs:count=101``   or at so many equally spaced times from 0 to the end
``verdict``             whether the theorem holds, with its reasons; each run is examined by itself
======================= ==============================================================================

The columns of the dataset:

======================================= =======================================================================
``row``                                 the number of the run
a varied name                           its value; ``parameter.stop`` for a parameter with the name of a column
``stop``, ``message``                   why it ended, a sentence where it did not get to where it was going
``verdict``                             whether the theorem holds; null where that was not examined
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

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from hsdsl.analysis.store.table import versions
from hsdsl.analysis.sweep.variation import Draw, Grid, Variation
from hsdsl.base.atomic import replacing
from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean, shown
from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.engine.execution import LEFT, Array, Ensemble, Execution
from hsdsl.engine.execution.records import optional
from hsdsl.engine.simulate.stops import limit, show

FILE, FORMAT, VERSION = "_sweep.json", "hsdsl sweep", 1


@dataclass(frozen=True)
class Manifest:
    """What a dataset is of.

    ``digest`` is the checksum of the model with its data, ``arguments`` are those of every run, ``states`` and
    ``outputs`` the names that have columns, ``chunk`` the number of rows of a file.
    ``tag`` is a checksum of all that decides what is in the rows; each file of the dataset carries it.
    """

    model: str
    digest: str
    title: str | None
    units: dict[str, str]
    variation: Variation
    recording: Recording
    arguments: dict[str, Any]
    states: tuple[str, ...]
    outputs: tuple[str, ...]
    chunk: int
    made_with: dict[str, str]
    tag: str = ""

    @property
    def chunks(self) -> int:
        """How many files a complete dataset has."""
        return -(-self.variation.rows // self.chunk)

    def rows_of(self, chunk: int) -> tuple[int, int]:
        """The first row of a chunk, and one more than the last."""
        return chunk * self.chunk, min((chunk + 1) * self.chunk, self.variation.rows)

    def plain(self) -> dict[str, Any]:
        """As JSON has it."""
        variation = self.variation
        content = {
            "format": FORMAT,
            "version": VERSION,
            "tag": self.tag,
            "hsdsl": self.made_with.get("hsdsl", ""),
            "versions": self.made_with,
            "model": self.model,
            "sha256": self.digest,
            "title": self.title,
            "units": self.units,
            "vary": [asdict(each) for each in (*variation.grids, *variation.draws)],
            "random": variation.random,
            "seed": variation.seed if variation.draws else None,
            "record": asdict(self.recording),
            "settings": self.arguments,
            "states": self.states,
            "outputs": self.outputs,
            "rows": variation.rows,
            "chunk": self.chunk,
        }
        return cast("dict[str, Any]", json.loads(json.dumps(content)))

    def write(self, folder: Path) -> None:
        """Write it into a folder."""
        with replacing(folder / FILE) as file:
            file.write((json.dumps(self.plain(), indent=1) + "\n").encode())

    def check_same(self, other: Manifest, folder: Path) -> None:
        """Refuse to go on with a dataset of something else.

        Raises UsageError: the other one is of another model, or other values or settings.
        """
        differing = [name for name, mine, theirs in _differences(self.plain(), other.plain()) if mine != theirs]
        if differing:
            raise UsageError(
                f"{folder} holds a sweep that differs in {', '.join(differing)}",
                "choose another folder, or remove this one to begin anew",
            )


DECIDING = {
    "sha256": "the model", "hsdsl": "the version of hsdsl", "vary": "what varies", "random": "the number of draws",
    "seed": "the seed", "record": "what is recorded", "settings": "the settings", "states": "the columns",
    "outputs": "the columns",
}  # fmt: skip


def _differences(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    for key, name in DECIDING.items():
        if key == "settings":
            yield name, _numbers(mine[key]), _numbers(theirs[key])
            continue
        detail = f"{name} ({theirs[key]}, not {mine[key]})" if key in ("hsdsl", "random", "seed") else name
        yield detail, mine[key], theirs[key]


def _numbers(settings: Any) -> Any:
    """Settings with each number as one, also where a command line gave its text."""
    if isinstance(settings, Mapping):
        return {name: _numbers(value) for name, value in cast("Mapping[str, Any]", settings).items()}
    if isinstance(settings, list):
        return [_numbers(value) for value in cast("list[Any]", settings)]
    if isinstance(settings, str):
        try:
            return float(settings)
        except ValueError:
            return settings.strip()
    return settings


def new(**fields: Any) -> Manifest:
    """A manifest in the format that this version of hsdsl writes."""
    untagged = Manifest(**fields, made_with=versions())
    text = json.dumps([untagged.plain()[key] for key in DECIDING], sort_keys=True)
    return replace(untagged, tag=hashlib.sha256(text.encode()).hexdigest())


def read(folder: Path) -> Manifest:
    """Read the manifest of a dataset.

    Raises UsageError: there is none, it is damaged, or a later version of hsdsl wrote it.
    """
    path = folder / FILE
    try:
        content = cast("dict[str, Any]", json.loads(path.read_bytes()))
        if content["format"] != FORMAT or type(content["version"]) is not int or content["version"] < 1:
            raise ValueError("another format")
        if content["version"] > VERSION:
            reason = f"a later version of hsdsl wrote it, in format {content['version']}; this one reads {VERSION}"
            raise UsageError(f"cannot read {path}: {reason}", "update hsdsl")
        grids, draws = list[Grid](), list[Draw]()
        for item in content["vary"]:
            if "values" in item:
                grids.append(Grid(str(item["name"]), tuple(map(float, item["values"])), bool(item["logarithmic"])))
            else:
                draws.append(Draw(str(item["name"]), str(item["distribution"]), tuple(map(float, item["arguments"]))))
        variation = Variation(tuple(grids), tuple(draws), int(content["random"]), int(content["seed"] or 0))
        chunk = int(content["chunk"])
        if variation.rows != content["rows"] or chunk < 1:
            raise ValueError("other rows")
        return Manifest(
            str(content["model"]), str(content["sha256"]), content["title"], dict(content["units"]), variation,
            Recording(**content["record"]), dict(content["settings"]), tuple(content["states"]),
            tuple(content["outputs"]), chunk, dict(content["versions"]), str(content["tag"]),
        )  # fmt: skip
    except FileNotFoundError:
        raise UsageError(f"{folder} is not a sweep: it has no {FILE}") from None
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror or error}") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise UsageError(f"cannot read {path}: it is damaged, or not the manifest of a sweep") from None


WORDS = ("final", "transitions", "outputs", "verdict")
EXAMPLE = "for example --record final,transitions,outputs:every=0.1"


@dataclass(frozen=True)
class Recording:
    """What is kept: ``samples`` is a number of samples, the time between them, or None.

    ``warnings`` are always kept; datasets of earlier versions have none.
    """

    final: bool = False
    transitions: bool = False
    samples: int | str | None = None
    verdict: bool = False
    warnings: bool = False

    @classmethod
    def read(cls, given: str | Sequence[str]) -> Recording:
        """Read a text, or its parts.

        Raises UsageError: an unknown word, or samples without their number.
        """
        parts = given.split(",") if isinstance(given, str) else given
        found: dict[str, Any] = {"warnings": True}
        for part in (part.strip() for part in parts):
            word, colon, how = part.partition(":")
            if word not in WORDS or (word == "outputs") != bool(colon):
                raise UsageError(
                    f"--record: expected {', '.join(WORDS)}, outputs with :every=TIME or :count=N, got '{shown(part)}'",
                    did_you_mean(word, WORDS) if word not in WORDS else EXAMPLE,
                )
            found |= {"samples": _samples(how)} if word == "outputs" else {word: True}
        return cls(**found)


def _samples(text: str) -> int | str:
    key, _, value = (part.strip() for part in text.partition("="))
    if key == "count" and value.isdecimal() and int(value) >= 2:
        return int(value)
    if key == "every" and value:
        return value
    raise UsageError(
        f"--record outputs: expected every=TIME or count=N with N at least 2, got '{shown(text)}'", EXAMPLE
    )


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


def table(manifest: Manifest, first: int, varied: Mapping[str, Array], ensemble: Ensemble) -> Any:
    """The rows of an ensemble, the first of which has the number ``first``, and the values that vary."""
    arrow, columns = library(), schema(manifest)
    values: dict[str, Any] = {column_of(name): column for name, column in varied.items()}
    values |= dict(_columns(manifest, first, ensemble))
    arrays = [
        _lists(arrow, values[field.name], field.type) if field.name.partition(".")[0] in LISTS
        else _column(arrow, values[field.name], field.type)
        for field in columns
    ]  # fmt: skip
    return arrow.table(arrays, schema=columns)


def _column(arrow: Any, values: Array, kind: Any) -> Any:
    """A column; a word that is in all rows is converted once, which takes a tenth of the time."""
    if kind == arrow.string() and (values == values[0]).all():
        return arrow.repeat(arrow.array(values[:1], type=kind, from_pandas=True)[0], len(values))
    return arrow.array(values, type=kind, from_pandas=True)


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
    count, judged = ensemble.stop.size, manifest.recording.verdict
    yield "row", np.arange(first, first + count)
    yield "stop", ensemble.stop
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
            messages[k] = None if run.stop.complete else accumulating(run) or run.stop.message
            if judged:
                verdicts[k], reasons[k] = run.verdict.theorem, run.verdict.reasons
                warnings[k] = " ".join(sorted({each.code for each in run.warnings if each.time is not None}))
    yield "message", messages
    yield "verdict", verdicts
    yield "warnings", warnings
    yield "verdict.reasons", reasons
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
    yield from ((f"sample.{name}", column) for name, column in _sample_columns(ensemble).items())


def _sample_columns(ensemble: Ensemble) -> dict[str, tuple[Array, Array]]:
    """Samples up to the end of each run, one after the other."""
    times = ensemble.sample_times
    with np.errstate(invalid="ignore"):
        inside = times <= (ensemble.time * (1 + TIE))[:, None]
    first = np.concatenate([[0], np.cumsum(inside.sum(axis=1))])
    columns = ensemble.samples | {"time": times}
    return {name: (first, column[inside]) for name, column in columns.items()}


NAMED, LATEST = 3, 64  # transitions that a reason names, and the last ones, among which they are sought


def accumulating(run: Execution) -> str | None:
    """The transitions that a run repeats up to a Zeno point, in a short sentence; None where none is repeated."""
    made = [each.edge for each in run.transitions[-LATEST:]]
    spans = (n for n in range(1, len(made) // 2 + 1) if made[-n:] == made[-2 * n : -n])
    if run.stop.reason != "zeno" or not (span := next(spans, 0)):
        return None
    edges = [*dict.fromkeys(made[-span:])]
    named = ", ".join(edges[:NAMED]) + f" and {len(edges) - NAMED} more" * (len(edges) > NAMED)
    return f"transitions of {named} accumulate at t = {show(run.stop.time)}; no motion is known there"


def _lists(arrow: Any, column: tuple[Array, Array], kind: Any) -> Any:
    first, values = column
    inner = arrow.array(values, type=kind.value_type, from_pandas=True)
    return arrow.ListArray.from_arrays(arrow.array(first, type=arrow.int32()), inner)
