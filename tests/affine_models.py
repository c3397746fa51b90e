"""Random affine models in the plane, and distances on them by a fine graph: slow, simple, and nothing shared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

REACH = 4.0  # half width of the boxes that are the domains


@dataclass(frozen=True)
class Glue:
    """A guard x = REACH on the right side of a mode (y between low and high), glued by y -> factor y + shift.

    The image lies on the line x = position of the target.
    """

    source: int
    target: int
    low: float
    high: float
    factor: float
    shift: float
    position: float


def random_glues(rng: np.random.Generator, modes: int, stretch: str) -> list[Glue]:
    """One guard for each mode; ``stretch`` says whether resets contract, keep or expand lengths."""
    factors = {"contracting": (0.3, 0.9), "isometric": (1.0, 1.0), "expanding": (1.1, 1.9)}[stretch]
    glues: list[Glue] = []
    for source in range(modes):
        low, high = np.sort(rng.uniform(-2, 2, size=2)).round(3)
        factor = round(float(rng.uniform(*factors)) * float(rng.choice((-1, 1))), 3)
        target = int(rng.integers(modes)) if source else (modes > 1) * 1
        position = round(float(rng.uniform(-3, 3)), 3)
        glues.append(Glue(source, target, float(low), float(high), factor, 0.0, position))
    return glues


def text_of(glues: list[Glue]) -> str:
    """The model as a file."""
    lines = ["hsdsl: 1", "modes:"]
    for glue in glues:
        lines += [
            f"  m{glue.source}:",
            "    flow: {x: 1, y: 0}",
            f"    domain: [x >= -{REACH}, y >= -{REACH}, y <= {REACH}]",
            "    transitions:",
            f"      - {{when: x >= {REACH}, to: m{glue.target}, if: y >= {glue.low} and y <= {glue.high},"
            f" reset: {{x: {glue.position}, y: {glue.factor}*y + {glue.shift}}}}}",
        ]
    return "\n".join([*lines, "initial: {mode: m0, x: 0, y: 0}", "experiment: {until: 1}", ""])


def graph_distance(glues: list[Glue], p, q, toll: float = 0.0, samples: int = 160) -> tuple[float, float]:
    """The shortest path over sampled guard points, and by how much sampling can lengthen it for each passage.

    ``p`` and ``q`` are (mode, x, y).
    """
    sides = [[(p[0], p[1], p[2])] * 2, [(q[0], q[1], q[2])] * 2]
    for glue in glues:
        for y in np.linspace(glue.low, glue.high, samples).tolist():
            sides.append([(glue.source, REACH, y), (glue.target, glue.position, glue.factor * y + glue.shift)])
    # A node for each side of each point; passing between the two sides costs the toll.
    nodes = np.array(sides, dtype=float).reshape(-1, 3)
    lengths = np.hypot(nodes[:, None, 1] - nodes[None, :, 1], nodes[:, None, 2] - nodes[None, :, 2])
    lengths[nodes[:, None, 0] != nodes[None, :, 0]] = np.inf
    first = np.arange(0, len(nodes), 2)
    lengths[first, first + 1] = lengths[first + 1, first] = toll
    lengths[[0, 1, 2, 3], [1, 0, 3, 2]] = 0.0  # p and q have one side
    rows, columns = np.nonzero(np.isfinite(lengths))
    weights = csr_array((np.maximum(lengths[rows, columns], 1e-12), (rows, columns)), shape=lengths.shape)
    spacing = max((glue.high - glue.low) / (samples - 1) * (1 + abs(glue.factor)) for glue in glues)
    return float(dijkstra(weights, indices=0)[2]), spacing
