"""Switched affine systems solved in 30 digits by matrix exponentials, written down from their published equations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mpmath as mp
import numpy as np
from scipy.linalg import expm

GRID = 4000


@dataclass(frozen=True)
class Piece:
    """z' = A z + b, left where ``normal . z = level`` is crossed from below, for each exit to a piece of its name."""

    matrix: list[list[float]]
    constant: list[float]
    exits: list[tuple[list[float], float, str]]

    def flow(self, z: list[Any], t: Any) -> list[Any]:
        """The state after a time, by the exponential of the matrix with the constant as a further column."""
        n = len(z)
        wide = mp.matrix(n + 1)
        for i in range(n):
            for j in range(n):
                wide[i, j] = mp.mpf(str(self.matrix[i][j]))
            wide[i, n] = mp.mpf(str(self.constant[i]))
        return list((mp.expm(wide * t, method="taylor") * mp.matrix([*z, 1]))[:n])


def switches(pieces: dict[str, Piece], name: str, start: list[str], until: float) -> list[tuple[Any, str, str]]:
    """The time of each transition, with the pieces before and after it."""
    found: list[tuple[Any, str, str]] = []
    with mp.workdps(30):
        z, t = [mp.mpf(v) for v in start], mp.mpf(0)
        while (following := _first(pieces[name], z, until - float(t))) is not None:
            after, target = following
            z, t = pieces[name].flow(z, after), t + after
            found.append((t, name, target))
            name = target
    return found


def _first(piece: Piece, z: list[Any], left: float) -> tuple[Any, str] | None:
    """The first exit: a scan with floats, then a root of the exact flow."""
    n, h = len(z), left / GRID
    wide = np.zeros((n + 1, n + 1))
    wide[:n, :n], wide[:n, n] = piece.matrix, piece.constant
    step, point = expm(wide * h), np.array([*map(float, z), 1.0])
    for k in range(GRID):
        following = step @ point
        for normal, level, target in piece.exits:
            if normal @ following[:n] > level and (normal @ point[:n] < level or k):

                def residual(t: Any, normal: Any = normal, level: Any = level) -> Any:
                    return mp.fdot(map(mp.mpf, map(str, normal)), piece.flow(z, t)) - mp.mpf(str(level))

                return mp.findroot(residual, (k * h, (k + 1) * h), solver="anderson", tol=1e-26), target
        point = following
    return None


def ball() -> list[tuple[Any, str, str]]:
    """From 10.2 at rest, g = 9.81, restitution 3/4: flights of 2 v/g."""
    with mp.workdps(30):
        g, t = mp.mpf("9.81"), mp.sqrt(2 * mp.mpf("10.2") / mp.mpf("9.81"))
        v, times = g * t, []
        while t < 8:
            times.append((t, "always", "always"))
            v = v * 3 / 4
            t += 2 * v / g
    return times


def oscillator() -> list[tuple[Any, str, str]]:
    """X' = -2 x +- 1.4, y' = -y -+ 0.7, switching on x = 0 and on y + 5/7 x = 0."""
    matrix, line = [[-2.0, 0.0], [0.0, -1.0]], [5.0, 7.0]
    east, north = [1.4, -0.7], [-1.4, 0.7]
    pieces = {
        "ne": Piece(matrix, east, [([-a for a in line], 0, "se")]),
        "se": Piece(matrix, north, [([-1.0, 0.0], 0, "sw")]),
        "sw": Piece(matrix, north, [(line, 0, "nw")]),
        "nw": Piece(matrix, east, [([1.0, 0.0], 0, "ne")]),
    }
    return switches(pieces, "ne", ["0.25", "0.05"], 6)


def tanks() -> list[tuple[Any, str, str]]:
    """X1' = -x1 - 2 or -x1 + 3, x2' = x1 or x1 - x2 - 5, switching on x1 = -1, x1 = 1, x2 = 0 and x2 = 1."""
    pieces: dict[str, Piece] = {}
    for first, a in (("off", -2.0), ("on", 3.0)):
        for second, d, b in (("off", 0.0, 0.0), ("on", -1.0, -5.0)):
            left = ([-1.0, 0.0], 1, f"on_{second}") if first == "off" else ([1.0, 0.0], 1, f"off_{second}")
            right = ([0.0, 1.0], 1, f"{first}_on") if second == "off" else ([0.0, -1.0], 0, f"{first}_off")
            pieces[f"{first}_{second}"] = Piece([[-1.0, 0.0], [1.0, d]], [a, b], [left, right])
    return switches(pieces, "off_on", ["1.7", "1"], 5)


def heater() -> list[tuple[Any, str, str]]:
    """T' = (30 - T)/10 up to 22, T' = -T/10 down to 18: logarithms."""
    with mp.workdps(30):
        t, found = 10 * mp.log(mp.mpf(11) / 8), []
        while t < 20:
            found.append((t, "heating_busy", "cooling_idle"))
            found.append((t + 10 * mp.log(mp.mpf(22) / 18), "cooling_idle", "heating_busy"))
            t = found[-1][0] + 10 * mp.log(mp.mpf(12) / 8)
    return found


def navigation() -> list[tuple[Any, str, str]]:
    """X' = v, v' = A (v - d) with d of the cell, A = (-1.2, 0.1; 0.1, -1.2), in unit cells of the map B24/434/22A."""
    root = 0.7071067811865476
    desired = {"B": None, "A": None, 2: (1.0, 0.0), 3: (root, -root), 4: (0.0, -1.0)}
    cells = [["B", 2, 4], [4, 3, 4], [2, 2, "A"]]
    a = [[-1.2, 0.1], [0.1, -1.2]]
    pieces: dict[str, Piece] = {}

    def name(c: int, r: int) -> str:
        kind = cells[2 - r][c]
        return kind if isinstance(kind, str) else f"cell_{c}_{r}"

    for c in range(3):
        for r in range(3):
            d = desired[cells[2 - r][c]]
            if d is None:
                pieces[name(c, r)] = Piece([[0.0] * 4] * 4, [0.0] * 4, [])
                continue
            matrix = [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, *a[0]], [0.0, 0.0, *a[1]]]
            constant = [0.0, 0.0, *(-row[0] * d[0] - row[1] * d[1] for row in a)]
            sides = [(1, 0, [1.0, 0, 0, 0], c + 1), (-1, 0, [-1.0, 0, 0, 0], -c)]
            sides += [(0, 1, [0, 1.0, 0, 0], r + 1), (0, -1, [0, -1.0, 0, 0], -r)]
            inside = [(n, level, c + i, r + j) for i, j, n, level in sides if 0 <= c + i < 3 and 0 <= r + j < 3]
            pieces[name(c, r)] = Piece(matrix, constant, [(n, level, name(i, j)) for n, level, i, j in inside])
    return switches(pieces, "cell_1_2", ["1.6", "2.4", "-0.2", "0.2"], 5)


BY_NAME = {
    "bouncing-ball": ball,
    "filtered-oscillator": oscillator,
    "two-tanks": tanks,
    "heater": heater,
    "navigation": navigation,
}
