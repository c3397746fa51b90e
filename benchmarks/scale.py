"""What large flat models cost: chains of masses with stops (`tests/chains.py`), and the grid of 625 modes.

For each number of masses: processor seconds to load, lower and compile the first time, and again with everything kept;
processor time of a run for each step and state; memory. SciPy and scikit-SUNDAE run with events, in turns with ours:
how many times as long the fastest of their runs takes. CVODE has its sparse solver, or its banded one, for which each
mass's states stand together. It runs to the same tolerance, and to the first of those that are quartered from there
whose error is no larger than ours. Errors are the largest of a state at the end, against a run of ours to 1e-12; CVODE
agrees with that to the error printed. Then chains whose masses all come to rest on their stops, and a stiff chain by
`radau`. Processor time is that of all threads, so those that only wait must not be there.

    OMP_NUM_THREADS=1 python benchmarks/scale.py [10 50 100 200 500]
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import sksundae as sun
from scipy.integrate import solve_ivp
from scipy.sparse import bmat, diags, eye

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from chains import chain
from lint.grid import grid

import hsdsl

TOLERANCE, UNTIL, TURNS, REPETITIONS = 1e-6, 2.0, 3, 20
MOST_FOR_SCIPY = 500  # masses: it calls each of their events in Python at each step
STIFFNESS, GAP, BOUNCE = 4.0, 0.25, 0.5  # as in tests/chains.py
START = """
import resource, sys, time
import hsdsl
from hsdsl.engine.runtime.kernel import CompiledModel, runtime
def spent():
    return time.process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
runtime()
CompiledModel(hsdsl.load(sys.argv[2]).program)
began = spent()
model = hsdsl.load(sys.argv[1])
CompiledModel(model.program)
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(spent() - began, int(peak.split()[1]) / 1024)
"""


def started(text: str) -> tuple[float, float, float]:
    """Seconds to compiled code the first time and the next, and the memory that the next one takes, in MB."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder, name) for name in ("model.yaml", "small.yaml")]
        for path, content in zip(paths, (text, chain(1)), strict=True):
            path.write_text(content)
        environment = {**os.environ, "XDG_CACHE_HOME": folder}
        command = [sys.executable, "-c", START, *map(str, paths)]
        runs = [subprocess.run(command, env=environment, capture_output=True, check=True, text=True) for _ in "12"]
    (first, _), (again, memory) = (map(float, run.stdout.split()) for run in runs)
    return first, again, memory


class Chain:
    """The same chain for solvers that take a flow and events, restarted at each event."""

    def __init__(self, n: int, damping: float) -> None:
        self.n, self.damping = n, damping
        self.at = np.array([(i * 7 % 11 - 5) / 40 for i in range(n)] + [(i * 5 % 13 - 6) / 8 for i in range(n)])

    def flow(self, x: np.ndarray, out: np.ndarray) -> None:
        n = self.n
        out[:n] = x[n:]
        force = STIFFNESS * x[:n] + self.damping * x[n:]
        out[n:] = -2 * force
        out[n + 1 :] += force[:-1]
        out[n:-1] += force[1:]

    def pattern(self) -> Any:
        n = self.n
        near = diags([np.ones(n - 1), np.ones(n), np.ones(n - 1)], [-1, 0, 1])
        return bmat([[None, eye(n)], [near, near]]).tocsc()

    def bounced(self, x: np.ndarray, hit: np.ndarray) -> np.ndarray:
        """The state after the impacts of masses that hit together."""
        x = x.copy()
        x[self.n :][hit] *= -BOUNCE
        return x

    def by_scipy(self, until: float) -> tuple[int, np.ndarray]:
        """Run by `solve_ivp`; returns how many impacts there were, and the state at the end."""

        def stop(k: int) -> Callable[[float, np.ndarray], float]:
            def event(_: float, x: np.ndarray) -> float:
                return x[k] - GAP

            event.terminal, event.direction = True, 1  # type: ignore[attr-defined]
            return event

        def rates(_: float, x: np.ndarray) -> np.ndarray:
            out = np.empty_like(x)
            self.flow(x, out)
            return out

        events, t, x, count = [stop(k) for k in range(self.n)], 0.0, self.at, 0
        while True:
            found = solve_ivp(rates, (t, until), x, rtol=TOLERANCE, atol=TOLERANCE, events=events)
            if found.status != 1:
                return count, found.y[:, -1]
            hit = np.array([len(times) > 0 for times in found.t_events])
            t, x, count = found.t[-1], self.bounced(found.y[:, -1], hit), count + int(hit.sum())

    def by_cvode(
        self, until: float, banded: bool = False, tolerance: float = TOLERANCE
    ) -> Callable[[], tuple[int, np.ndarray]]:
        """The same by CVODE with its sparse solver, or its banded one and the states mass by mass, made once."""
        n = self.n
        order = np.arange(2 * n).reshape(2, n).T.ravel() if banded else np.arange(2 * n)
        place = np.argsort(order)  # of each state among those that CVODE has
        rate, at = np.empty(2 * n), place[:n]

        def rates(_: float, x: np.ndarray, out: np.ndarray) -> None:
            if not banded:
                return self.flow(x, out)
            self.flow(x[place], rate)
            out[:] = rate[order]
            return None

        def events(_: float, x: np.ndarray, out: np.ndarray) -> None:
            out[:] = x[at] - GAP

        events.terminal, events.direction = [True] * n, [1] * n  # type: ignore[attr-defined]
        sparse = {"linsolver": "sparse", "sparsity": self.pattern()}
        options = {"linsolver": "band", "lband": 3, "uband": 2} if banded else sparse
        options |= {"rtol": tolerance, "atol": tolerance, "max_num_steps": 1_000_000}
        solver = sun.cvode.CVODE(rates, eventsfn=events, num_events=n, **options)

        def run() -> tuple[int, np.ndarray]:
            t, x, count = 0.0, self.at, 0
            while True:
                found = solver.solve(np.array([t, until]), x[order])
                if not found.success:
                    raise RuntimeError(f"CVODE stopped at {found.t[-1]}: {found.message}")
                if found.status != 2:
                    return count, np.atleast_2d(found.y)[-1][place]
                hit = np.atleast_2d(found.i_events)[-1] != 0
                t, x = float(np.ravel(found.t_events)[-1]), self.bounced(np.atleast_2d(found.y_events)[-1][place], hit)
                count += int(hit.sum())

        return run


def fastest(*runs: Callable[[], Any]) -> list[float]:
    """Processor seconds of the fastest of several runs of each, taking turns; the first is run more often."""
    best = [float("inf")] * len(runs)
    for _ in range(TURNS):
        for i, run in enumerate(runs):
            for _ in range(1 if i else REPETITIONS):
                began = process_time()
                run()
                best[i] = min(best[i], process_time() - began)
    return best


def end_of(model: hsdsl.Model, n: int, tolerance: float) -> np.ndarray:
    """The state at the end of our run."""
    state = model.simulate(tolerance=tolerance).final.state
    return np.array([state[f"{name}{i}"] for name in "xv" for i in range(n)])


def row(n: int) -> str:
    """One line of the table."""
    first, again, memory = started(chain(n))
    model, other = hsdsl.loads(chain(n, until=UNTIL)), Chain(n, 1 / 20)
    found = model.simulate(tolerance=TOLERANCE)
    exact = end_of(model, n, 1e-12)

    def off(end: np.ndarray) -> float:
        return float(np.abs(end - exact).max())

    own_error = off(end_of(model, n, TOLERANCE))
    tolerance, peers = TOLERANCE, [other.by_cvode(UNTIL), other.by_cvode(UNTIL, banded=True)]
    while off(other.by_cvode(UNTIL, banded=True, tolerance=tolerance)()[1]) > own_error:
        tolerance /= 4
    peers += [other.by_cvode(UNTIL, tolerance=tolerance), other.by_cvode(UNTIL, banded=True, tolerance=tolerance)]
    peers += [lambda: other.by_scipy(UNTIL)] if n <= MOST_FOR_SCIPY else []
    errors = [off(end) for count, end in (peer() for peer in peers) if count == len(found.transitions)]
    if len(errors) < len(peers):
        print("other impacts:", end=" ")
    own, *others = fastest(lambda: model.simulate(tolerance=TOLERANCE), *peers)
    each = own / len(found.times) / (2 * n) * 1e9
    return (
        f"{n:5}  {first:6.2f} s  {again:6.2f} s  {memory:5.0f} MB  {len(found.transitions):5}  {own * 1e3:8.2f} ms"
        f"  {each:6.0f} ns  {own_error:.0e}  {tolerance:.0e}"
        f"  {'  '.join(f'{time / own:5.2f} x ({error:.0e})' for time, error in zip(others, errors, strict=False))}"
    )


def resting(n: int) -> str:
    """One line about a chain that a force presses on its stops, until all masses rest there."""
    text = chain(n, until=12).replace(" + c*(", " + 1 + c*(").replace("k: 4", "k: 1/64")
    began = process_time()
    model = hsdsl.loads(text)
    kept = model.program.contacts[0]
    loaded = process_time() - began
    found = model.simulate(tolerance=TOLERANCE)
    began = process_time()
    model.simulate(tolerance=TOLERANCE)
    own = process_time() - began
    rest = sum(abs(found.final.state[f"v{i}"]) <= TOLERANCE for i in range(n))
    each = own / len(found.times) / (2 * n) * 1e9
    return (
        f"{n:5}  lowered in {loaded:6.2f} s  {len(kept.routines.source) / n / 1e3:5.1f} kB of routines a mass  "
        f"{len(found.transitions):6} impacts  {own:6.2f} s"
        f"  {each:6.0f} ns a step and state  {rest} at rest"
        f"{'' if found.stop.complete else f' as {found.stop.reason} ended the run at t = {found.times[-1]:.3g}'}"
    )


def main() -> None:
    """Print the tables."""
    print(
        "    n     first     again    memory  impacts      run   step/state  error  CVODE's tolerance"
        "  times as long (error): CVODE sparse and banded at 1e-06, sparse and banded at that tolerance, SciPy",
        flush=True,
    )
    for n in map(int, sys.argv[1:] or (10, 50, 100, 200, 500)):
        print(row(n), flush=True)
    print("masses that come to rest on their stops:", flush=True)
    for n in map(int, sys.argv[1:] or (10, 50, 100, 200)):
        print(resting(n), flush=True)
    first, again, memory = started(grid(25))
    print(f"625 modes: {first:.2f} s, again {again:.2f} s, {memory:.0f} MB", flush=True)
    model, other = hsdsl.loads(chain(200, 1e4, until=UNTIL)), Chain(200, 1e4)
    options = {"method": "radau", "tolerance": TOLERANCE}
    found = model.simulate(**options)
    own, cvode = fastest(lambda: model.simulate(**options), other.by_cvode(UNTIL))
    print(
        f"stiff chain of 200: radau {own * 1e3:.1f} ms ({len(found.times)} rows, {len(found.transitions)} impacts), "
        f"CVODE {cvode * 1e3:.1f} ms, {cvode / own:.1f} x",
        flush=True,
    )


if __name__ == "__main__":
    main()
