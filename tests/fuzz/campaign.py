"""Many inputs in worker processes, each with 5 seconds and 1 GiB: count them, and keep what breaks.

python tests/fuzz/campaign.py --kind expressions --inputs 100000
python tests/fuzz/campaign.py --kind documents --seconds 600 --workers 4
python tests/fuzz/campaign.py --kind bytes --replay 4711

Input number N of a kind and a seed is always the same one, as long as the files it is made from stay the same. Exit
code 1 where anything was found: an exception that is not a refusal, a hang, too much memory, or a payload that did
something. A hang is 5 seconds of processor time; the longest of any input is given in processor time and on the wall's
clock, with how many took over 5 s of the latter only because the machine had other work.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from random import Random
from typing import Any

sys.path[:0] = [str(Path(__file__).resolve().parents[1]), str(Path(__file__).resolve().parents[2])]
sys.path = [entry for entry in sys.path if Path(entry or ".").resolve() != Path(__file__).resolve().parent]

from fuzz import generators, targets  # noqa: E402
from hsdsl.base.processes import Lost, in_processes  # noqa: E402

Block = tuple["Counter[str]", list[dict[str, Any]], "Times", int]  # how far inputs got, faults, times, peak of memory
KINDS = {"bytes": generators.raw, "expressions": generators.expression, "documents": generators.document}
SECONDS, MEMORY = 5.0, 1 << 30
BLOCK = 200
SLOW = 1.0


class Hang(BaseException):
    """An input that took too long."""


def _hang(*_: Any) -> None:
    raise Hang


@contextmanager
def limited_time(seconds: float = SECONDS) -> Generator[None]:
    """Raise :class:`Hang` after some processor time; what the system itself spends on a busy machine is not counted."""
    before = signal.signal(signal.SIGVTALRM, _hang)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)


def of_index(kind: str, seed: int, index: int) -> tuple[str | bytes, Random]:
    """Input number ``index``, and the randomness that is left for the rest."""
    rng = Random(f"{seed}:{kind}:{index}")
    return KINDS[kind](rng), rng


def work(options: argparse.Namespace, folder: Path, at: Any, block: int) -> Block:
    """Feed a block of inputs; ``at`` has the one that each block is at."""
    guard, inside = _workplace(folder / str(os.getpid()))
    found: list[dict[str, Any]] = []
    ways: Counter[str] = Counter()
    times = Times()
    for index in range(options.start + block * BLOCK, options.start + (block + 1) * BLOCK):
        at[block] = index
        with times.of_one():
            way, fault = one(options.kind, options.seed, index, options.share, guard, inside)
        ways[way] += 1
        if fault:
            found.append({"kind": options.kind, "seed": options.seed, "index": index, **fault})
    return ways, found, times, _status("VmHWM")


@cache
def _workplace(folder: Path) -> tuple[Any, Path]:
    """The guard and the folder of a process, which may take so much memory from here on."""
    inside = targets.prepared(folder)
    os.chdir(inside)
    guard = targets.Guard(inside)
    targets.feed_document(b"", Random(0), inside, 1.0)
    base = _status("VmSize")
    resource.setrlimit(resource.RLIMIT_AS, (base + MEMORY, base + MEMORY))
    return guard, inside


@dataclass
class Times:
    """What inputs took: the longest in processor time and in wall clock, and how many waited for a busy machine."""

    processor: float = 0.0
    wall: float = 0.0
    waited: int = 0

    @contextmanager
    def of_one(self) -> Generator[None]:
        """Count one input."""
        processor, wall = os.times().user, time.monotonic()
        yield
        processor, wall = os.times().user - processor, time.monotonic() - wall
        self.add(Times(processor, wall, int(processor <= SECONDS < wall)))

    def add(self, other: Times) -> None:
        """Take others in."""
        self.processor, self.wall = max(self.processor, other.processor), max(self.wall, other.wall)
        self.waited += other.waited

    def plain(self) -> dict[str, Any]:
        """As numbers to be printed."""
        return {
            "longest_processor_seconds": round(self.processor, 2),
            "longest_wall_seconds": round(self.wall, 2),
            "over_5_wall_seconds_only": self.waited,
        }


def one(kind: str, seed: int, index: int, share: float, guard: Any, folder: Path) -> tuple[str, dict[str, Any] | None]:
    """One input under its limits: how far it got, and what went wrong."""
    data, rng = of_index(kind, seed, index)
    began, clock = os.times().user, time.monotonic()
    fault, way = None, "broken"
    try:
        with limited_time(), guard.watch():
            way = targets.feed(kind, data, rng, folder, share)
    except Hang as error:
        fault = {"what": "hang", "trace": _trace(error)}
    except BaseException as error:
        fault = {"what": type(error).__name__, "message": str(error)[:400], "trace": _trace(error)}
    took = os.times().user - began
    if fault is None and took > SLOW:
        fault = {"what": "slow", "trace": [way]}
    if fault is not None:
        fault |= {"seconds": round(took, 2), "wall": round(time.monotonic() - clock, 2), "input": _text(data)[:3000]}
    return way, fault


def _trace(error: BaseException) -> list[str]:
    frames = traceback.extract_tb(error.__traceback__)[-12:]
    return [f"{Path(f.filename).name}:{f.lineno} {f.name}" for f in frames]


def _status(key: str) -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(key + ":"):
            return int(line.split()[1]) * 1024
    return 0


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Feed until the inputs or the seconds are spent; a process that hangs where no signal reaches it is ended."""
    began = time.monotonic()
    ways: Counter[str] = Counter()
    times = Times()
    faults: list[dict[str, Any]] = []
    peak, blocks = 0, range(-(-options.inputs // BLOCK))
    at = multiprocessing.RawArray("q", len(blocks))
    with tempfile.TemporaryDirectory() as folder:
        feed = partial(work, options, Path(folder), at)
        for done, (block, answer) in enumerate(in_processes(feed, blocks, options.workers, BLOCK * SLOW), start=1):
            if isinstance(answer, Lost):  # with the rest of its block
                answer = Counter(), [_lost(options, at[block], answer.word)], Times(), 0
            counted, found, took, high = answer
            ways.update(counted)
            times.add(took)
            faults += found
            peak = max(peak, high)
            for fault in found:
                if fault["what"] != "slow":
                    print(_line(fault), file=sys.stderr, flush=True)
            if done % 50 == 0:
                _say(options, ways, faults, began)
            if time.monotonic() - began > options.seconds:
                break
    return {
        "kind": options.kind, "seed": options.seed, "inputs": sum(ways.values()), "first": options.start,
        "seconds": round(time.monotonic() - began), "ways": dict(ways), **times.plain(), "peak_bytes": peak,
        "faults": faults,
    }  # fmt: skip


def _lost(options: argparse.Namespace, index: int, word: str) -> dict[str, Any]:
    """The fault of an input whose process gave no answer."""
    data, _ = of_index(options.kind, options.seed, index)
    common = {"kind": options.kind, "seed": options.seed, "index": index}
    return {**common, "what": word, "trace": [word], "input": _text(data)[:3000]}


def _text(data: str | bytes) -> str:
    return data if isinstance(data, str) else data.decode("utf-8", "backslashreplace")


def _say(options: argparse.Namespace, ways: Counter[str], faults: list[dict[str, Any]], began: float) -> None:
    counted = ", ".join(f"{n:,} {way}" for way, n in ways.most_common())
    grave = sum(f["what"] != "slow" for f in faults)
    print(f"{options.kind}: {counted}; {grave} faults, {len(faults) - grave} slow, {time.monotonic() - began:.0f} s",
          file=sys.stderr, flush=True)  # fmt: skip


def _line(fault: dict[str, Any]) -> str:
    where = f"--kind {fault['kind']} --seed {fault['seed']} --replay {fault['index']}"
    return f"{fault['what']}: {where}: {fault.get('message', '')} {' > '.join(fault['trace'][-4:])}"


def distinct(faults: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One of each sort, the shortest input first found."""
    sorts: dict[tuple[str, str], dict[str, Any]] = {}
    for fault in faults:
        if fault["what"] == "slow":
            continue
        key = (fault["what"], fault["trace"][-1] if fault["trace"] else "")
        kept = sorts.setdefault(key, {**fault, "times": 0})
        kept["times"] += 1
    return list(sorts.values())


def parsed(arguments: list[str] | None = None) -> argparse.Namespace:
    """The options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", choices=KINDS, required=True)
    parser.add_argument("--inputs", type=int, default=10_000)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--start", type=int, default=0, help="the number of the first input")
    parser.add_argument("--share", type=float, default=0.15, help="how many of the legal ones are lowered and run")
    parser.add_argument("--out", type=Path, help="write counts and faults as JSON")
    parser.add_argument("--replay", type=int, help="feed one input and let its exception through")
    return parser.parse_args(arguments)


def main() -> int:
    """Run a campaign, or one input of it again."""
    options = parsed()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that the processes end with it
    if options.replay is not None:
        return replay(options)
    result = run(options)
    if options.out:
        options.out.write_text(json.dumps(result, indent=1), encoding="utf-8")
    grave = distinct(result["faults"])
    for fault in grave:
        print(f"{fault['times']} x {_line(fault)}")
    print(json.dumps({**result, "faults": sum(f["what"] != "slow" for f in result["faults"]),
                      "slow": sum(f["what"] == "slow" for f in result["faults"])}))  # fmt: skip
    return 1 if grave else 0


def replay(options: argparse.Namespace) -> int:
    """One input again, here."""
    data, rng = of_index(options.kind, options.seed, options.replay)
    print(_text(data))
    with tempfile.TemporaryDirectory() as folder:
        inside = targets.prepared(Path(folder))
        began = time.process_time()
        print(targets.feed(options.kind, data, rng, inside, options.share), time.process_time() - began, "s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
