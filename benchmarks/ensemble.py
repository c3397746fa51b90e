"""Ten thousand oscillators with a stop, restitution and forcing varied: how long, and is every impact right?

Timed on all cores, warm. Then each run's impacts are compared with those of the closed form, followed in
float64 from impact to impact: between two samples of 2e-3 it looks at every maximum that comes near the stop, so that a
short visit is not missed. That takes minutes; `--checked` says how many of the runs are.

With `--against hand,heyoka` one thread is first compared in turns with a program written by hand and with heyoka's
batches of eight runs, by processor time; `alone` is one thread that steps one run at a time.

    python benchmarks/ensemble.py [--instances 10000] [--checked 10000] [--tolerance 1e-10] [--against hand,heyoka]
"""

from __future__ import annotations

import argparse
import ctypes
import math
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
from engines import compiled

import hsdsl
from hsdsl.engine.simulate import ensemble

FILE = Path(__file__).parent.parent / "models" / "oscillator-with-stop-1.yaml"
A, W, STOP, START = 0.05, 2.5, 14.0, (11.36, 31.4)
WD = math.sqrt(W * W - A * A)
UNTIL = 40 * math.pi
GRID = np.arange(1, 4001) * 2e-3
DECAY, COSINE, SINE = np.exp(-A * GRID), np.cos(WD * GRID), np.sin(WD * GRID)
MOST = 200  # impacts of one run
BATCH = 8
Columns = dict[str, np.ndarray]
Curve = Callable[[float], float]


def varied() -> hsdsl.Model:
    """The model with the amplitude of its forcing as a parameter."""
    text = FILE.read_text(encoding="utf-8")
    text = text[: text.index("# Between impacts")].replace("{a: 0.05,", "{A: 20, a: 0.05,").replace("20*cos", "A*cos")
    return hsdsl.loads(text)


def impacts(c: float, amplitude: float) -> Iterator[float]:
    """The times of impacts by the closed form."""
    p, t, (x, v) = amplitude / (2 * A * W), 0.0, START
    while t < UNTIL:
        cosine = x - p * math.sin(W * t)
        sine = (v - p * W * math.cos(W * t) + A * cosine) / WD

        def position(s: float, t: float = t, c: float = cosine, d: float = sine) -> float:
            return p * math.sin(W * (t + s)) + math.exp(-A * s) * (c * math.cos(WD * s) + d * math.sin(WD * s))

        def velocity(s: float, t: float = t, c: float = cosine, d: float = sine) -> float:
            co, si = math.cos(WD * s), math.sin(WD * s)
            return p * W * math.cos(W * (t + s)) + math.exp(-A * s) * (-A * (c * co + d * si) + WD * (d * co - c * si))

        there = p * np.sin(W * (t + GRID)) + DECAY * (cosine * COSINE + sine * SINE)
        bracket = first_visit(there, position, velocity)
        if bracket is None:
            s = float(GRID[-1])
            x, v, t = position(s), velocity(s), t + s
            continue
        s = bisected(*bracket, lambda s: position(s) > STOP)
        if t + s > UNTIL:
            return
        x, v, t = STOP, -c * velocity(s), t + s
        yield t


def first_visit(there: np.ndarray, position: Curve, velocity: Curve) -> tuple[float, float] | None:
    """Where the position first goes beyond the stop: a time before it and one beyond."""
    above = np.flatnonzero(there > STOP)
    until = int(above[0]) if len(above) else len(there)
    middle, before, after = there[1:-1], there[:-2], there[2:]
    tops = np.flatnonzero((middle >= before) & (middle >= after) & (middle > STOP - 1e-2)) + 1
    for i in tops[tops < until]:
        top = bisected(float(GRID[i - 1]), float(GRID[i + 1]), lambda s: velocity(s) <= 0)
        if position(top) > STOP:
            return float(GRID[i - 1]), top
    return None if not len(above) else (float(GRID[until - 1]) if until else 0.0, float(GRID[until]))


def bisected(low: float, high: float, beyond: Callable[[float], bool]) -> float:
    """The last number before something holds."""
    while True:
        middle = (low + high) / 2
        if middle in (low, high):
            return low
        low, high = (low, middle) if beyond(middle) else (middle, high)


def by_hand(parameters: Columns, tolerance: float) -> Callable[[], None]:
    """The program by hand, which has the model written into its loop."""
    folder = tempfile.TemporaryDirectory()
    library = compiled(Path(folder.name), "taylor_by_hand")
    library.prepare()
    double = ctypes.c_double

    def run() -> None:
        for c, amplitude in zip(parameters["c"], parameters["A"], strict=True):
            model = A, c, amplitude, W, W, STOP, *START, 0.0, tolerance, UNTIL
            library.taylor(*map(double, model), 0, None, None)
        assert folder

    return run


def by_heyoka(parameters: Columns, tolerance: float) -> Callable[[], None]:
    """Batches of eight runs, whose resets are callbacks."""
    import heyoka as hy

    x, v = hy.make_vars("x", "v")
    c = np.zeros(BATCH)

    def bounce(ta: Any, _: int, k: int) -> bool:
        ta.state[1, k] *= -c[k]
        return True

    event = hy.t_event_batch(x - STOP, callback=bounce, direction=hy.event_direction.positive)
    flow = [(x, v), (v, hy.par[0] * hy.cos(W * hy.time) - 2 * A * v - W * W * x)]
    start, pars = np.zeros((2, BATCH)), np.zeros((1, BATCH))
    ta = hy.taylor_adaptive_batch(flow, start, tol=tolerance, t_events=[event], pars=pars)

    def run() -> None:
        for k in range(0, len(parameters["c"]) // BATCH * BATCH, BATCH):
            ta.set_time(0.0)
            ta.state[:] = np.array(START)[:, None]
            ta.pars[0], c[:] = parameters["A"][k : k + BATCH], parameters["c"][k : k + BATCH]
            ta.reset_cooldowns()
            ta.propagate_until(UNTIL)

    return run


def compare(tools: dict[str, Callable[[], Any]], instances: int, turns: int) -> None:
    """Print the processor time of a run, the least and the median of some turns."""
    spent: dict[str, list[float]] = {name: [] for name in tools}
    for _ in range(turns):
        for name, run in tools.items():
            began = process_time()
            run()
            spent[name].append((process_time() - began) / instances * 1e6)
    for name, times in spent.items():
        print(f"{name:8} {min(times):8.1f} us a run, median {np.median(times):8.1f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--instances", type=int, default=10_000)
    parser.add_argument("--checked", type=int)
    parser.add_argument("--tolerance", type=float, default=1e-10)
    parser.add_argument("--repetitions", type=int, default=9)
    parser.add_argument("--against", default="", help="hand, heyoka")
    options = parser.parse_args()
    rng = np.random.default_rng(20_260)
    parameters = {"c": rng.uniform(0.3, 0.95, options.instances), "A": rng.uniform(8, 30, options.instances)}
    settings = {"scheme": "located", "method": "taylor", "tolerance": options.tolerance, "until": UNTIL}
    model = varied()
    model.ensemble(parameters={name: values[:8] for name, values in parameters.items()}, **settings)
    if options.against:
        few = {name: values[: options.instances // BATCH * BATCH] for name, values in parameters.items()}

        def alone() -> None:
            least, ensemble.FEWEST_IN_LANES = ensemble.FEWEST_IN_LANES, options.instances + 1
            model.ensemble(parameters=few, threads=1, **settings)
            ensemble.FEWEST_IN_LANES = least

        tools = {"hsdsl": partial(model.ensemble, parameters=few, threads=1, **settings), "alone": alone}
        peers = {"hand": by_hand, "heyoka": by_heyoka}
        tools |= {name: peers[name](few, options.tolerance) for name in options.against.split(",")}
        tools["hsdsl"]()  # compiles its lanes, where that takes it long enough
        compare(tools, len(few["c"]), options.repetitions)
    spent: list[float] = []
    for _ in range(options.repetitions):
        began = perf_counter()
        found = model.ensemble(parameters=parameters, **settings)
        spent.append(perf_counter() - began)
    print(f"{options.instances:,} runs: {min(spent):.2f} s (of {', '.join(f'{s:.2f}' for s in spent)}), {found}")
    found = model.ensemble(parameters=parameters, transition_times=MOST, **settings)
    wrong, total, worst = 0, 0, 0.0
    for k in range(options.instances if options.checked is None else options.checked):
        exact = np.array([*impacts(float(parameters["c"][k]), float(parameters["A"][k]))])
        total += len(exact)
        off = np.abs(found.transition_times[k][: len(exact)] - exact)
        if found.transitions[k] != len(exact) or not (off < 1e-4).all():
            wrong += 1
            print(
                f"wrong: c = {parameters['c'][k]}, A = {parameters['A'][k]}: {found.transitions[k]}, not {len(exact)}"
            )
            continue
        worst = max(worst, off.max(initial=0.0))
    print(f"{total:,} impacts, {wrong} runs wrong, times within {worst:.2e}")


if __name__ == "__main__":
    main()
