"""Chains of masses between walls, each with springs and dampers to its neighbours and a stop of its own: large models.

python tests/chains.py 50 > chain.yaml        50 masses, 100 states, 50 transitions
python tests/chains.py 200 1e4 > chain.yaml   the same with dampers that make the chain stiff
"""

from __future__ import annotations

import sys

HEAD = """hsdsl: 1
title: A chain of {n} masses with stops

parameters: {{k: 4, c: {c}, gap: 1/4, e: 1/2}}

modes:
  chain:
    flow:
"""


def chain(n: int, damping: float | str = "1/20", until: float | str = 10) -> str:
    """Write the model: mass i moves by x{i} at v{i}, and bounces off a stop at the distance ``gap``."""

    def mass(i: int) -> str:
        left, right = (i - 1, i + 1) if 0 < i < n - 1 else (i - 1, None) if i else (None, i + 1 if n > 1 else None)
        x = " + ".join([*(f"x{j}" for j in (left, right) if j is not None), f"-2*x{i}"]).replace("+ -", "- ")
        v = x.replace("x", "v")
        return f"      x{i}: v{i}\n      v{i}: k*({x}) + c*({v})\n"

    stops = (f"      - {{name: stop{i}, when: x{i} >= gap, to: chain, reset: {{v{i}: -e*v{i}}}}}\n" for i in range(n))
    start = "".join(f", x{i}: {(i * 7 % 11 - 5) / 40}, v{i}: {(i * 5 % 13 - 6) / 8}" for i in range(n))
    return "".join(
        (
            HEAD.format(n=n, c=damping),
            *map(mass, range(n)),
            "    transitions:\n",
            *stops,
            f"\ninitial: {{mode: chain{start}}}\nexperiment: {{until: {until}}}\n",
        )
    )


if __name__ == "__main__":
    print(chain(int(sys.argv[1]), *sys.argv[2:]), end="")
