# pyright: basic
"""The semantic test suite of SBML: how many of its cases the language expresses, and how many runs are right.

Each case is imported as `hsdsl import` does, the text that this prints is run as the case's settings say, and every
number must be within the case's absolute plus relative tolerance. Runs with many transitions are compiled. A case may
take 30 s of processor time; where its verdict takes longer, the numbers alone decide.

    git clone --depth 1 https://github.com/sbmlteam/sbml-test-suite
    python benchmarks/sbml.py sbml-test-suite/cases/semantic [--cases 1-200] [--every 10] [--processes 2] [--verbose]
"""

from __future__ import annotations

import argparse
import csv
import re
import signal
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

import hsdsl
from hsdsl.interface.imports.sbml import DEEPEST, FEATURE, imported
from hsdsl.language.source.xml import read_xml

TOLERANCE = 1e-10
BEYOND = 1e-6  # runs are longer by this share: the suite counts what happens at the last instant, as floor(t) does
TIE = 1e-12  # relative: times that differ by less are one
MANY = 2000  # transitions from which on a run is compiled
LONGEST = 30.0  # seconds of processor time that a case may take


class NotExpressible(Exception):
    """A case that is no course of time, or not one alone."""


class TimedOut(BaseException):
    """A case that took too long; no handler of exceptions keeps it."""


@dataclass(frozen=True)
class Outcome:
    """What became of a case, and why.

    It is ``right``, ``wrong``, ``stopped``, ``timed out``, ``not loaded``, ``refused`` (what the language has no words
    for) or ``not asked``.
    """

    case: str
    kind: str
    reason: str = ""
    verdict: str = ""
    seconds: float = 0.0


def settings(folder: Path) -> dict[str, Any]:
    """The settings of a case."""
    pairs = re.findall(r"^(\w+):[ \t]*(.*?)\s*$", next(folder.glob("*-settings.txt")).read_text(), re.MULTILINE)
    given: dict[str, Any] = dict(pairs)
    for name in ("variables", "amount", "concentration"):
        given[name] = [word for word in re.split(r"[,\s]+", given.get(name, "")) if word]
    return given


def model_file(folder: Path) -> Path:
    """The newest version of a case's model."""
    return max(folder.glob("*-sbml-l*v*.xml"), key=lambda path: path.stem[-4:])


def text_of(folder: Path) -> str:
    """A case in the language, as `hsdsl import` prints it."""
    given = settings(folder)
    if not given["start"]:
        raise NotExpressible("flux balance: a steady state, not a course of time")
    kinds = {name: kind for kind in ("amount", "concentration") for name in given[kind]}
    outputs = {name: kinds.get(name, "value") for name in given["variables"]}
    end = float(given["start"]) + float(given["duration"])
    path = model_file(folder)
    text = imported(read_xml(str(path), path.read_bytes(), DEEPEST), repr(end * (1 + BEYOND)), outputs)
    tags = re.search(r"^\s*testTags:.*", next(folder.glob("*-model.m")).read_text("latin-1"), re.M)
    if tags and "RandomEventExecution" in tags[0] and "equal priority is that of the file" in text:
        raise NotExpressible("a random choice between more events than can be compared")
    return text


def expected(folder: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The times of the results, and their columns."""
    with next(folder.glob("*-results.csv")).open() as file:
        header, *rows = [[cell.strip() for cell in row] for row in csv.reader(file) if row]
    values = np.array([[float(cell) for cell in row] for row in rows])
    return values[:, 0], dict(zip(header[1:], values[:, 1:].T, strict=True))


def made_behind(model: Any, run: Any, times: np.ndarray) -> np.ndarray:
    """At which times the flow reaches strict events alone: they are made beyond it, as at the end of a run (M8)."""
    strict = {edge.name for mode in model.program.modes for edge in mode.edges if edge.strict}
    made = [(float(m.time), m.edge in strict and not m.entry) for m in run.transitions if " re-arms" not in m.edge]
    near = [[behind for time, behind in made if abs(time - t) <= TIE * abs(t)] for t in times]
    return np.array([bool(found) and all(found) for found in near])


def differences(folder: Path, text: str, model: Any, run: Any) -> str:
    """Where a run of a text is off the results of a case; nothing where it is right."""
    given, (times, columns) = settings(folder), expected(folder)
    samples, before = run.sample(times), run.sample(times * (1 - TIE), side="left")
    behind = made_behind(model, run, times)
    left_out = dict(re.findall(r"(\w+) = (-?inf|nan)\b", text.partition("# Left out")[2].partition("\n")[0]))
    for name, right in columns.items():
        if name in left_out:  # a constant that the text has in a comment: every number of a model is finite
            own = earlier = np.full(len(times), float(left_out[name]))
        else:
            own, earlier = samples[f"out_{name}"], before[f"out_{name}"]
        valued = np.isnan(own) & ~np.isnan(right)  # the last instant of a piece, where the next one has no value
        own = np.where(behind | valued, earlier, own)
        allowed = float(given["absolute"]) + float(given["relative"]) * np.abs(right)
        off = ~((np.abs(own - right) <= allowed) | (np.isnan(own) & np.isnan(right)) | (own == right))
        if off.any():
            first = int(np.argmax(off))
            return f"{name} at {times[first]:g}: expected {right[first]:.9g}, got {own[first]:.9g}"
    return ""


def too_long(*_: object) -> NoReturn:
    """End a case."""
    raise TimedOut


def outcome(folder: Path, engine: str) -> Outcome:
    """Run a case and compare."""
    began = time.process_time()

    def done(kind: str, reason: str = "", verdict: str = "") -> Outcome:
        return Outcome(folder.name, kind, reason, verdict, time.process_time() - began)

    verdict = "not in time"
    signal.signal(signal.SIGPROF, too_long)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        text = text_of(folder)
        model = hsdsl.loads(text)
        run = model.simulate(tolerance=TOLERANCE, engine=engine, max_transitions=MANY)
        if run.stop.reason == "transition_limit":
            run = model.simulate(tolerance=TOLERANCE)
        if run.stop.reason != "until":
            return done("stopped", f"{run.stop.reason}: {run.stop.message}")
        wrong = differences(folder, text, model, run)
        with suppress(TimedOut):
            verdict = run.verdict.theorem
    except NotExpressible as feature:
        return done("not asked", str(feature))
    except TimedOut:
        return done("timed out")
    except (hsdsl.ModelError, hsdsl.UsageError) as error:
        if isinstance(error, hsdsl.ModelError) and error.diagnostics[0].code == FEATURE:
            return done("refused", re.sub(r"<.*?>|: .*", "", error.diagnostics[0].message))
        return done("not loaded", str(error).strip().replace("\n", " | ")[:400])
    except Exception as error:  # every case must have its line
        return done("not loaded", f"DEFECT {type(error).__name__}: {error}"[:300])
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return done("wrong", wrong, verdict) if wrong else done("right", "", verdict)


def outcomes(folders: list[Path], processes: int, engine: str) -> Iterator[Outcome]:
    """The outcome of each case, in order."""
    if processes == 1:
        yield from (outcome(folder, engine) for folder in folders)
        return
    with ProcessPoolExecutor(processes) as pool:
        yield from pool.map(outcome, folders, [engine] * len(folders), chunksize=4)


def main() -> None:
    """Run the cases, and count."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("suite", type=Path)
    arguments.add_argument("--cases", default="1-99999", help="such as 1-200 or 39,41,900-950")
    arguments.add_argument("--every", type=int, default=1, help="only every so manyth of these")
    arguments.add_argument("--processes", type=int, default=1)
    arguments.add_argument("--engine", default="python", help="python compiles nothing, which is faster for short runs")
    arguments.add_argument("--verbose", action="store_true", help="a line for every case")
    given = arguments.parse_args()
    ranges = [[int(n) for n in part.split("-")] for part in given.cases.split(",")]
    numbered = [f for f in sorted(given.suite.iterdir()) if f.is_dir() and f.name.isdigit()]
    folders = [f for f in numbered if any(r[0] <= int(f.name) <= r[-1] for r in ranges)][:: given.every]
    kinds, verdicts, features = Counter[str](), Counter[str](), Counter[str]()
    began = time.perf_counter()
    for done in outcomes(folders, given.processes, given.engine):
        kinds[done.kind] += 1
        verdicts[f"{done.kind}, verdict {done.verdict}"] += bool(done.verdict)
        features[f"{done.kind}: {done.reason}"] += done.kind in ("refused", "not asked")
        if given.verbose or done.kind in ("wrong", "stopped", "timed out", "not loaded"):
            print(done.case, done.kind, done.verdict, done.reason, f"{done.seconds:.2f}s", flush=True)
    print(f"{sum(kinds.values())} cases in {time.perf_counter() - began:.0f} s")
    for counter in (kinds, verdicts, features):
        for what, count in counter.most_common():
            print(f"{count:5d}  {what}") if count else None


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    sys.setrecursionlimit(10000)
    main()
