# pyright: basic
"""Public models of SpaceEx: how many are imported and run, with which options, and why the others are not.

Every file below FOLDER that is a model of SpaceEx is imported as it is. Where that is refused, it is imported with
`--at centre`, with `--urgent`, and with both; then it is run, to its `time-horizon` or until 10. The configuration is
the file of the same name, else one whose name goes on after it, else that of the folder where it has one model alone.

    python benchmarks/spaceex.py FOLDER [--verbose]

FOLDER holds checkouts of repositories with such models, a folder each; the table has a line for each of them.
"""

from __future__ import annotations

import argparse
import re
import signal
import time
import warnings
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import hsdsl
from hsdsl.interface.imports.spaceex import imported

OPTIONS: dict[str, dict[str, Any]] = {
    "as it is": {},
    "--at centre": {"at": ["centre"]},
    "--urgent": {"urgent": True},
    "--at centre --urgent": {"at": ["centre"], "urgent": True},
}
LONGEST = 30  # seconds of one file
UNTIL = "10"  # where no configuration has a time-horizon


class Outcome(NamedTuple):
    """What became of a file: ``runs``, ``stops`` or ``refused``, the options it took, and why."""

    kind: str
    options: str
    reason: str
    transitions: int = 0


def models(folder: Path) -> list[Path]:
    """The models of SpaceEx below a folder."""
    files = (path for path in sorted(folder.rglob("*.xml")) if path.is_file())
    return [path for path in files if b"<sspaceex" in path.read_bytes()]


def configuration(path: Path) -> Path | None:
    """The configuration of a model."""
    beside = sorted(path.parent.glob("*.cfg"))
    alone = len([p for p in path.parent.glob("*.xml") if b"<sspaceex" in p.read_bytes()]) == 1
    rules = (lambda c: c.stem == path.stem, lambda c: c.stem.startswith(path.stem), lambda _: alone)
    return next((c for rule in rules for c in beside if rule(c)), None)


def read(path: Path, options: dict[str, Any]) -> str:
    """The text of a model, which runs until its time-horizon."""
    cfg = configuration(path)
    try:
        return imported(path, cfg, **options)
    except hsdsl.UsageError as error:
        if "end of the run" not in str(error):
            raise
        return imported(path, cfg, UNTIL, **options)


def outcome(path: Path) -> Outcome:
    """Import a file and run it."""
    reason = ""
    for words, options in OPTIONS.items():
        try:
            text = read(path, options)
        except hsdsl.ModelError as error:
            reason = reason or error.diagnostics[0].message
            continue
        except hsdsl.UsageError as error:
            reason = reason or str(error)
            continue
        run = hsdsl.loads(text).simulate(engine="python")
        kind = "runs" if run.stop.reason in ("until", "final") else "stops"
        return Outcome(kind, words, f"{run.stop.reason}, {run.verdict.theorem}", len(run.transitions))
    return Outcome("refused", "", reason)


def timed(path: Path) -> Outcome:
    """The outcome, or that it takes too long."""

    def late(*_: Any) -> None:
        raise TimeoutError

    signal.signal(signal.SIGALRM, late)
    signal.alarm(LONGEST)
    try:
        return outcome(path)
    except TimeoutError:
        return Outcome("refused", "", f"more than {LONGEST} s")
    except Exception as error:  # every file must have its line
        return Outcome("refused", "", f"DEFECT {type(error).__name__}: {error}"[:200])
    finally:
        signal.alarm(0)


def main() -> None:
    """Measure all files, and count."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--verbose", action="store_true", help="a line for every file")
    given = arguments.parse_args()
    kinds: dict[str, Counter[str]] = defaultdict(Counter)
    reasons, jumping = Counter[str](), 0
    for path in models(given.folder):
        began, place = time.perf_counter(), path.relative_to(given.folder)
        found = timed(path)
        group = place.parts[0]
        kinds[group][f"{found.kind} {found.options}".strip()] += 1
        jumping += found.kind == "runs" and found.transitions > 0
        generic = re.sub(r"\([^()]*\)", "", re.sub(r"(?:'[^']*'|`[^`]*`)(?:, '[^']*')*", "X", found.reason))
        reasons[re.sub(r"(in )?location \w+", r"\1location Y", generic).strip()] += found.kind == "refused"
        if given.verbose:
            what = (found.kind, found.options, found.reason, f"{found.transitions} transitions")
            print(place, *what, f"{time.perf_counter() - began:.1f}s", sep=" | ", flush=True)
    columns = sorted({kind for counter in kinds.values() for kind in counter})
    print("| files of |", " | ".join(columns), "| all |")
    for group, counter in [*kinds.items(), ("all", sum(kinds.values(), Counter()))]:
        print(f"| {group} |", " | ".join(str(counter[kind]) for kind in columns), f"| {sum(counter.values())} |")
    print(f"{jumping} of those that run make transitions")
    for reason, count in reasons.most_common():
        print(f"{count:5d}  {reason}") if count else None


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
