"""What the stiff method needs on known stiff problems, beside SciPy's Radau, which is the same method.

For each problem of `tests/convergence/stiff` and tolerance: the error at the end relative to 1 + |x|, steps accepted,
derivatives, factorings of the pair of matrices, iterations (three flows each), and time by the compiled engine, warm.
SciPy counts evaluations of the flow, and factorings one matrix at a time. Its tolerances are the same numbers; the two
do not mean the same by them, so errors are to be compared as well.

    python benchmarks/stiff.py [--repetitions 20]
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import hsdsl
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.backends.python import PythonKernel
from hsdsl.engine.scheme import newton, radau

PROBLEMS = sorted((Path(__file__).parents[1] / "tests" / "convergence" / "stiff").glob("*.yaml"))
COUNTED = (radau, "evaluate_jacobian"), (radau, "factor_dense"), (radau, "factor_sparse"), (newton, "iterate")
TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-11)


def counted(model: Any, tolerance: float) -> tuple[int, int, int]:
    """What one run asks for: derivatives, factorings, iterations. The engines take the same steps; Python's count."""
    made = Counter[str]()
    plain = [(module, name, getattr(module, name)) for module, name in COUNTED]

    def counting(function: Any) -> Any:
        def noted(*given: Any) -> Any:
            made[function.__name__] += 1
            return function(*given)

        return noted

    for module, name, function in plain:
        setattr(module, name, counting(function))
    try:
        model.simulate(tolerance=tolerance, engine="python")
    finally:
        for module, name, function in plain:
            setattr(module, name, function)
    return made["evaluate_jacobian"], made["factor_dense"] + made["factor_sparse"], made["iterate"]


def fastest(run: Any, repetitions: int) -> float:
    """Seconds of the fastest of several runs."""
    times: list[float] = []
    for _ in range(repetitions):
        began = perf_counter()
        run()
        times.append(perf_counter() - began)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=20)
    repetitions = parser.parse_args().repetitions
    for path in PROBLEMS:
        model = hsdsl.load(path)
        kernel = PythonKernel(model.program, FLOAT64)
        known = model.system.reference[0]["states"][0]
        field, slopes = kernel.bind(0, ()).flow, kernel.jacobian(0, ())
        first = model.simulate(tolerance=1e-6)
        start, n, until = first.values[0], len(first.values[0]), first.stop.time
        exact = np.array([float(known[name]) for name in first.final.state])
        print(f"{path.stem}: {n} states, to t = {until:g}")
        for tolerance in TOLERANCES:
            run = model.simulate(tolerance=tolerance, engine="c")
            error = np.max(np.abs(run.values[-1] - exact) / (1 + np.abs(exact)))
            derived, factored, iterations = counted(model, tolerance)
            spent = fastest(lambda: model.simulate(tolerance=tolerance, engine="c"), repetitions)  # noqa: B023
            print(
                f"  {tolerance:.0e}  ours   error {error:.1e}  steps {len(run.times) - 1:6}  J {derived:5}  "
                f"LU {factored:5}  iterations {iterations:6}  {1e6 * spent:9.0f} us"
            )

            def theirs() -> Any:
                return solve_ivp(
                    lambda t, x: field(t, *x),  # noqa: B023
                    (0, until),  # noqa: B023
                    start,  # noqa: B023
                    "Radau",
                    jac=lambda t, x: np.reshape(slopes(t, *x), (n, n)),  # noqa: B023
                    rtol=tolerance,  # noqa: B023
                    atol=tolerance,  # noqa: B023
                )

            began = perf_counter()
            found = theirs()
            spent = perf_counter() - began
            error = np.max(np.abs(found.y[:, -1] - exact) / (1 + np.abs(exact)))
            print(
                f"         SciPy  error {error:.1e}  steps {len(found.t) - 1:6}  J {found.njev:5}  "
                f"LU {found.nlu // 2:5}  iterations {found.nfev // 3:6}  {1e6 * spent:9.0f} us"
            )


if __name__ == "__main__":
    main()
