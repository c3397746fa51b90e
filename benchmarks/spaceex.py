# pyright: basic
"""Public models of SpaceEx: how many are imported and run, with which options, and why the others are not.

Every file below FOLDER that is a model of SpaceEx is imported as it is. Where that is refused, it is imported with
`--at centre`, with `--urgent`, and with both; then it is run, to its `time-horizon` or until 10. The configuration is
the file of the same name, else one whose name goes on after it, else that of the folder where it has one model alone.

    python benchmarks/spaceex.py FOLDER [--check] [--verbose]

FOLDER holds checkouts of repositories with such models, a folder each; the table has a line for each of them.
"""

from __future__ import annotations

import argparse
import math
import re
import signal
import time
import warnings
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from scipy.integrate import solve_ivp

import hsdsl
from hsdsl.interface.imports.spaceex import imported

OPTIONS: dict[str, dict[str, Any]] = {
    "as it is": {},
    "--at centre": {"at": ["centre"]},
    "--urgent": {"urgent": True},
    "--at centre --urgent": {"at": ["centre"], "urgent": True},
}
CHECK = False  # hold what jumps against SciPy
LONGEST = 30  # seconds of one file
UNTIL = "10"  # where no configuration has a time-horizon


class Outcome(NamedTuple):
    """What became of a file: ``runs``, ``stops`` or ``refused``, the options it took, and why."""

    kind: str
    options: str
    reason: str
    transitions: int = 0
    off: float = math.nan  # from an execution by SciPy


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
        run = hsdsl.loads(text).simulate(tolerance=1e-12)
        kind = "runs" if run.stop.reason in ("until", "final") else "stops"
        off = difference(text, run) if CHECK and kind == "runs" and 0 < len(run.transitions) <= MOST else math.nan
        return Outcome(kind, words, f"{run.stop.reason}, {run.verdict.theorem}", len(run.transitions), off)
    return Outcome("refused", "", reason)


SIDES = re.compile(r"(.+?)\s*(<=|>=|<|>)\s*(.+)")
TIGHT: dict[str, Any] = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13}
MOST = 200  # transitions


class Scipy:
    """An execution by SciPy of the text of a model: a second reading of it, which shares no code with this package."""

    def __init__(self, text: str) -> None:
        document = yaml.load(text, yaml.BaseLoader)  # all words as text: `off` is a name
        self.names: dict[str, float] = {"pi": math.pi, **{f: getattr(math, f) for f in ("sin", "cos", "exp", "sqrt")}}
        for name, given in document.get("parameters", {}).items():
            self.names[name] = self.value(given["value"] if isinstance(given, dict) else given, {})
        self.modes, start = document["modes"], dict(document["initial"])
        self.until = self.value(document["experiment"]["until"], {})
        self.mode, self.time, self.jumps, self.state = start.pop("mode"), 0.0, 0, dict[str, float]()
        self.made: Any = None  # the transition before
        for name, given in start.items():
            ends = [given["min"], given["max"]] if isinstance(given, dict) else [given]
            self.state[name] = sum(self.value(end, self.state) for end in ends) / len(ends)

    def value(self, text: Any, names: dict[str, float]) -> float:
        """The value of an expression of the model, in the state and the names of `let`."""
        decimal = re.sub(r"(?<![\w.])0+(?=\d)", "", str(text))  # 00 is no number of Python
        return float(eval(decimal, {"__builtins__": {}}, {**self.names, **names}))

    def all_names(self, state: dict[str, float]) -> dict[str, float]:
        """The state, and what `let` defines in the mode."""
        found = dict(state)
        for name, text in self.modes[self.mode].get("let", {}).items():
            found[name] = self.value(text, found)
        return found

    def excess(self, text: str, names: dict[str, float]) -> float:
        """How far an inequality holds: at least zero where it does."""
        matched = SIDES.fullmatch(str(text).strip())
        assert matched is not None
        left, sign, right = matched.groups()
        return (self.value(left, names) - self.value(right, names)) * (1 if sign[0] == ">" else -1)

    def holds(self, text: Any, names: dict[str, float], within: float) -> bool:
        """Whether a conjunction holds, within the error of a root."""
        parts = str(text).split(" and ") if text not in (None, "true") else []
        return all(self.excess(part, names) >= -within for part in parts)

    def step(self) -> bool:
        """Follow the flow to the next transition and make it; whether there is one."""
        mode, keys = self.modes[self.mode], list(self.modes[self.mode]["flow"])
        edges = mode.get("transitions", [])

        def names(x: Any) -> dict[str, float]:
            return self.all_names(dict(zip(keys, map(float, x), strict=True)))

        def flow(_: float, x: Any) -> list[float]:
            known = names(x)
            return [self.value(mode["flow"][key], known) for key in keys]

        begin = [self.state[key] for key in keys]
        now, soon = names(begin), names([x + 1e-9 * v for x, v in zip(begin, flow(0, begin), strict=True)])
        for edge in edges:
            if "event" in edge and edge is not self.made and self.holds(edge["event"], now, 0.0):
                return self.jump(edge, now)
            here, then = (self.excess(edge["when"], at) if "when" in edge else -1.0 for at in (now, soon))
            on = here < 1e-12 and self.holds(edge.get("if"), now, 0.0)
            if here > -1e-12 and then > 1e-12 and ("if" not in edge or on):
                return self.jump(edge, now)
        surfaces = [(e, s) for e in edges for s in ([e["when"]] if "when" in e else e["event"].split(" and "))]

        def guard(surface: str) -> Any:
            function = lambda _, x: self.excess(surface, names(x))  # noqa: E731
            function.direction = 1.0
            return function

        guards, x, least = [guard(s) for _, s in surfaces], begin, self.time + 1e-11
        while self.time < self.until:
            end = min(self.until, self.time + max(self.until / 50, 1e-3))
            found = solve_ivp(flow, (self.time, end), x, events=guards, **TIGHT)
            times = enumerate(found.t_events or [])
            roots = sorted((time_, k) for k, each in times for time_ in each if time_ > least)
            for time_, k in roots:
                point = solve_ivp(flow, (self.time, time_), x, **TIGHT).y[:, -1]
                edge, known = surfaces[k][0], names(point)
                if self.holds(edge.get("if"), known, 1e-9) and self.holds(edge.get("event"), known, 1e-9):
                    self.time = time_
                    return self.jump(edge, known)
            self.time, x = end, list(found.y[:, -1])
        self.state = dict(zip(keys, map(float, x), strict=True))
        return False

    def jump(self, edge: dict[str, Any], known: dict[str, float]) -> bool:
        """Make a transition."""
        reset = {name: self.value(text, known) for name, text in edge.get("reset", {}).items()}
        self.mode, self.jumps, self.made = edge["to"], self.jumps + 1, edge
        self.state = {key: reset.get(key, known.get(key, math.nan)) for key in self.modes[self.mode]["flow"]}
        return self.jumps <= MOST


def difference(text: str, run: Any) -> float:
    """How far the end of a run is from that of SciPy, relative to the state's size; infinite where modes differ."""
    other = Scipy(text)
    while other.step():
        pass
    final = run.final
    if (other.mode, other.jumps) != (final.mode, len(run.transitions)):
        return math.inf
    a, b = (np.array([state[key] for key in other.state]) for state in (final.state, other.state))
    return float(np.max(np.abs(a - b), initial=0.0) / np.max(np.abs(b), initial=1.0))  # a mode may have no states


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
    except hsdsl.ModelError as error:  # what is printed is larger than a file may be
        return Outcome("refused", "", str(error).partition("error ")[2].partition("\n")[0])
    except Exception as error:  # every file must have its line
        return Outcome("refused", "", f"DEFECT {type(error).__name__}: {error}"[:200])
    finally:
        signal.alarm(0)


def main() -> None:
    """Measure all files, and count."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--verbose", action="store_true", help="a line for every file")
    arguments.add_argument("--check", action="store_true", help="hold runs that jump against executions by SciPy")
    given = arguments.parse_args()
    globals()["CHECK"] = given.check
    kinds: dict[str, Counter[str]] = defaultdict(Counter)
    reasons, jumping, checked = Counter[str](), 0, list[float]()
    for path in models(given.folder):
        began, place = time.perf_counter(), path.relative_to(given.folder)
        found = timed(path)
        group = place.parts[0]
        kinds[group][f"{found.kind} {found.options}".strip()] += 1
        checked += [found.off] if not math.isnan(found.off) else []
        jumping += found.kind == "runs" and found.transitions > 0
        generic = re.sub(r"\([^()]*\)", "", re.sub(r"(?:'[^']*'|`[^`]*`)(?:, '[^']*')*", "X", found.reason))
        reasons[re.sub(r"(in )?location \w+", r"\1location Y", generic).strip()] += found.kind == "refused"
        if given.verbose:
            what = (found.kind, found.options, found.reason, f"{found.transitions} transitions", f"{found.off:.1e}")
            print(place, *what, f"{time.perf_counter() - began:.1f}s", sep=" | ", flush=True)
    columns = sorted({kind for counter in kinds.values() for kind in counter})
    print("| files of |", " | ".join(columns), "| all |")
    for group, counter in [*kinds.items(), ("all", sum(kinds.values(), Counter()))]:
        print(f"| {group} |", " | ".join(str(counter[kind]) for kind in columns), f"| {sum(counter.values())} |")
    print(f"{jumping} of those that run make transitions")
    near = [off for off in checked if off <= 1e-8]
    print(f"{len(near)} of {len(checked)} end within 1e-8 of SciPy, at most {max(near, default=0):.1e} off")
    for reason, count in reasons.most_common():
        print(f"{count:5d}  {reason}") if count else None


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
