"""What a verdict costs: processor time of a run and of its verdict.

The scenes of `benchmarks/scenes.py` by `located`, and chains of 50 masses (`tests/chains.py`): without stops that are
hit, with some, and with masses that hit theirs together. Run and verdict take turns. Printed are the medians, how many
times the run's time the verdict takes, the verdict, and whether the run was repeated for it.

    python benchmarks/verdict.py [S1 S4 chain]
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import process_time

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from chains import chain

import hsdsl

MODELS = Path(__file__).parent.parent / "models"
TURNS = 60


def of_model(name: str, scheme: str = "located") -> Callable[[], hsdsl.Execution]:
    """Run a model by `located` with a tolerance."""
    model = hsdsl.load(MODELS / f"{name}.yaml")
    return lambda: model.simulate(scheme=scheme, tolerance=1e-9)


def of_chain(mirrored: bool = False, **parameters: str) -> Callable[[], hsdsl.Execution]:
    """Run a chain of 50 masses; mirrored, the masses of one half move as those of the other, and hit as they do."""
    model = hsdsl.loads(chain(50, until=10))
    first = model.simulate()
    start = dict(zip(first.states, first.values[0].tolist(), strict=True))
    initial = {f"{s}{49 - i}": start[f"{s}{i}"] for i in range(25) for s in "xv"} if mirrored else {}
    return lambda: model.simulate(parameters=parameters, initial=initial)


SCENES: dict[str, Callable[[], Callable[[], hsdsl.Execution]]] = {
    "S1": lambda: of_model("oscillator-with-stop-1"),
    "S2": lambda: of_model("oscillator-with-stop-2"),
    "S3": lambda: of_model("bouncing-ball"),
    "S4": lambda: of_model("pronking-runner"),
    "S5": lambda: of_model("stiff-switch"),
    "chain": lambda: of_chain(gap="10"),
    "hits": of_chain,
    "ties": lambda: of_chain(mirrored=True),
}


def row(name: str) -> str:
    """One line of the table."""
    simulate = SCENES[name]()
    run, spent = simulate(), list[tuple[float, float]]()
    for _ in range(TURNS):
        began = process_time()
        run = simulate()
        ran = process_time()
        run.verdict  # noqa: B018
        spent.append((ran - began, process_time() - ran))
    own, verdict = (median(each) * 1e3 for each in zip(*spent[TURNS // 6 :], strict=True))
    how = "finer run" if "finer" in run.__dict__ else ""
    return f"{name:6} {run.made:5} {own:8.3f} {verdict:10.3f} {verdict / own:6.2f}  {run.verdict.theorem:8} {how}"


if __name__ == "__main__":
    print("scene   made   run/ms verdict/ms  times")
    for name in sys.argv[1:] or SCENES:
        print(row(name), flush=True)
