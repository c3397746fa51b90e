"""A large model to lint: a square of cells, each with linear dynamics of its own for the velocity of a moving point.

    python tests/lint/grid.py > grid.yaml         the 625 modes of a square with 25 cells a side
    python tests/lint/grid.py 5 > grid.yaml       25 modes

This is the navigation benchmark of Fehnker and Ivancic (2004) on a larger board: in every cell the velocity relaxes
towards a direction of that cell's own, and the four sides of a cell lead to its neighbours.
"""

from __future__ import annotations

import sys

HEAD = """hsdsl: 1
title: Navigation on {n} by {n} cells

parameters: {{a: 1.2, b: 0.1}}

modes:
"""
TAIL = """
initial: {{mode: c0_0, x: 0.5, y: 0.5, vx: 0.6, vy: 0.2}}
experiment: {{until: {n}}}
"""
DIRECTIONS = ((0, 1), (0.6, 0.8), (1, 0), (0.6, -0.8), (0, -1), (-0.6, -0.8), (-1, 0), (-0.6, 0.8))


def cell(i: int, j: int, n: int) -> str:
    """The mode of column i and row j; a side without a neighbour is a wall."""
    ux, uy = DIRECTIONS[(3 * i + 5 * j) % len(DIRECTIONS)]
    sides = (
        (f"x >= {i + 1}", f"x <= {i + 1}", i + 1, j),
        (f"x <= {i}", f"x >= {i}", i - 1, j),
        (f"y >= {j + 1}", f"y <= {j + 1}", i, j + 1),
        (f"y <= {j}", f"y >= {j}", i, j - 1),
    )
    inside = [(when, k, m) for when, _, k, m in sides if 0 <= k < n and 0 <= m < n]
    walls = [wall for _, wall, k, m in sides if not (0 <= k < n and 0 <= m < n)]
    lines = [
        f"  c{i}_{j}:",
        "    flow:",
        "      x: vx",
        "      y: vy",
        f"      vx: -a*(vx - {ux}) + b*(vy - {uy})",
        f"      vy: b*(vx - {ux}) - a*(vy - {uy})",
        *([f"    domain: [{', '.join(walls)}]"] if walls else []),
        "    transitions:",
        *(f"      - {{when: {when}, to: c{k}_{m}}}" for when, k, m in inside),
    ]
    return "\n".join(lines) + "\n"


def grid(n: int = 25) -> str:
    """The text of a model with n**2 modes."""
    cells = "".join(cell(i, j, n) for j in range(n) for i in range(n))
    return HEAD.format(n=n) + cells + TAIL.format(n=n)


if __name__ == "__main__":
    print(grid(int(sys.argv[1]) if len(sys.argv) > 1 else 25), end="")
