"""How often the covariance of fits to noisy samples covers the true parameters, over many tries.

python benchmarks/fit_coverage.py [TRIES]
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.stats import beta, chi2, kstest, norm

import hsdsl

TRUE = {"c": 0.9, "a": 0.05}
NOISE, LEVEL = 0.05, 0.95


def tried(model: hsdsl.Model, times: np.ndarray, exact: np.ndarray, noise: np.random.Generator) -> np.ndarray:
    """The deviations of one fit from the true values: of both jointly, squared, and of each in its own deviations."""
    data = {"t": times, "x": exact + NOISE * noise.standard_normal(len(times))}
    found = model.fit(data, list(TRUE), sigma={"x": NOISE}, parameters={"c": 0.88, "a": 0.055})
    off = np.array([found.values[name] - value for name, value in TRUE.items()])
    return np.array([off @ np.linalg.solve(found.covariance, off), *(off / [found.deviations[p] for p in TRUE])])


def main() -> None:
    """Print the shares with their intervals of 95 % (Clopper and Pearson), and how chi-square is met."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    model, noise = hsdsl.load("models/oscillator-with-stop-1.yaml"), np.random.default_rng(7)
    times = np.linspace(0, 6, 201)[1:]
    exact = model.simulate(until=6, scheme="located", method="taylor", tolerance=1e-14).sample(times)["x"]
    found = np.array([tried(model, times, exact, noise) for _ in range(count)])
    inside = {"both together": found[:, 0] < chi2.ppf(LEVEL, 2)}
    inside |= {name: np.abs(found[:, k]) < norm.ppf((1 + LEVEL) / 2) for k, name in enumerate(TRUE, 1)}
    for name, column in inside.items():
        k = int(column.sum())
        low, high = beta.ppf(0.025, k, count - k + 1), beta.ppf(0.975, k + 1, count - k)
        print(f"{name:14} {k} of {count} within 95 %, interval {low:.4f} to {high:.4f}")
    print(f"squared deviations: mean {found[:, 0].mean():.4f} (2), against chi-square p = "
          f"{kstest(found[:, 0], chi2(2).cdf).pvalue:.3f}")  # fmt: skip


if __name__ == "__main__":
    main()
