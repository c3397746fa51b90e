"""How long each tool takes to be right to so many digits: forced oscillators, ball, runner, stiff switch.

Every tool runs every scene at many tolerances, warm and in turns, in one process. What counts is the least time at
which its largest error over 2,000 samples, sampling included, is below 1e-3, 1e-6, 1e-9, 1e-11. An answer that is not
the right execution (transitions missed or made up, another mode) has no time. S2s is S2 with a mode for rest at the
stop written by hand (`stick.yaml`), without which no other tool gets it right.

    python benchmarks/scenes.py [--against scipy,heyoka,sksundae,casadi] [--scenes S1,S4a] [--out scenes.csv]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

import hsdsl
from hsdsl.interface.chart import PEERS, Row, Scene, work_precision
from hsdsl.interface.chart.rows import as_csv

MODELS = Path(__file__).parent.parent / "models"
sys.path.insert(0, str(MODELS))

from references.bouncing_ball import bouncing_ball  # noqa: E402

TARGETS = (1e-3, 1e-6, 1e-9, 1e-11)
TOLERANCES = tuple(10 ** -(k / 2) for k in range(4, 27))
OURS = ("taylor", "dop853", "dopri5", "radau")
PATIENCE = 3.0  # seconds for one run: what is slower is not run at tighter settings


def of_model(name: str, states: Sequence[str], block: int = 0) -> Callable[[], Scene]:
    """A model as it stands, or from another of the starts that its reference has."""
    return lambda: Scene.of(hsdsl.load(MODELS / f"{name}.yaml"), states=states, block=block)


def ball() -> Scene:
    """The bouncing ball until 0.999 of the time at which it comes to rest."""
    model = hsdsl.load(MODELS / "bouncing-ball.yaml")
    exact = bouncing_ball(until=0.999 * 12.850588106343579)
    return Scene.of(model, states=["h"], exact=exact)


def stick() -> Scene:
    """Example 2 with a mode for rest at the stop, written by hand for tools that know no rest."""
    plain = of_model("oscillator-with-stop-2", ["x"])()
    exact = plain.exact.sample(plain.grid)
    at_rest = (exact["x"] == -0.8) & (exact["v"] == 0)
    model = hsdsl.load(Path(__file__).with_name("stick.yaml"))
    modes = np.where(at_rest, "held", "free").astype(object)
    return replace(plain, name="stick", model=model, exact_modes=modes)


SCENES: dict[str, Callable[[], Scene]] = {
    "S1": of_model("oscillator-with-stop-1", ["x"]),
    "S2": of_model("oscillator-with-stop-2", ["x"]),
    "S2s": stick,
    "S3": ball,
    "S4a": of_model("pronking-runner", ["x", "z", "th"], 1),
    "S4b": of_model("pronking-runner", ["x", "z", "th"]),
    "S5": of_model("stiff-switch", ["y1"]),
}


def fastest(rows: Sequence[Row], target: float) -> dict[str, Row]:
    """The fastest right answer to a target, by tool."""
    found: dict[str, Row] = {}
    for row in rows:
        if row.judgement.verdict == "right" and row.judgement.error <= target:
            tool = "hsdsl" if row.attempt.tool.name.startswith("hsdsl") else row.attempt.tool.name
            if tool not in found or row.timed.spread[0] < found[tool].timed.spread[0]:
                found[tool] = row
    return found


def lines(name: str, rows: Sequence[Row], tools: Sequence[str]) -> Iterator[str]:
    """A scene's table: microseconds of the fastest turn, and how much faster we are than the best peer."""
    for target in TARGETS:
        best = fastest(rows, target)
        micro = {tool: best[tool].timed.spread[0] * 1e6 if tool in best else inf for tool in ("hsdsl", *tools)}
        ours = best.get("hsdsl")
        how = f"{ours.attempt.tool.method} {ours.attempt.value:.1e}" if ours else "-"
        peer = min((micro[tool] for tool in tools), default=inf)
        columns = " ".join(f"{micro[tool]:>10.0f}" if micro[tool] < inf else f"{'-':>10}" for tool in tools)
        ratio = f"{peer / micro['hsdsl']:8.1f}" if peer < inf and ours else f"{'-':>8}"
        print_ours = f"{micro['hsdsl']:>9.1f}" if ours else f"{'-':>9}"
        yield f"{name:4} {target:7.0e} {print_ours} {how:16} {columns} {ratio}"


def main() -> None:
    """Run scenes and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", default="scipy,heyoka,sksundae,casadi")
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--methods", default=",".join(OURS))
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    against = [name for name in given.against.split(",") if name]
    if unknown := set(against) - set(PEERS):
        parser.error(f"no such peer: {', '.join(sorted(unknown))}")
    tools = [*against]
    heads = " ".join(f"{tool:>10}" for tool in tools)
    print(f"{'':4} {'error':>7} {'ours/us':>9} {'':16} {heads} {'ratio':>8}", flush=True)
    every: list[Row] = []
    for name in given.scenes.split(","):
        rows, remarks = work_precision(
            SCENES[name](),
            schemes=("located",),
            methods=given.methods.split(","),
            engines=("c",),
            tolerances=TOLERANCES,
            against=against,
            rounds=given.rounds,
            patience=PATIENCE,
            with_rho=False,
        )
        every += rows
        print("\n".join(lines(name, rows, tools)), flush=True)
        for remark in remarks:
            print(f"     left out: {remark}", flush=True)
    if given.out:
        given.out.write_text(as_csv(every))


if __name__ == "__main__":
    main()
