"""Executions written down from closed forms, for tests of everything that happens after a simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hsdsl.engine.execution import Arc, Execution, Point, Stop, Transition, Verdict

NAN = float("nan")


@dataclass
class Draft:
    """Collects arcs row by row; ``make`` pads them and closes the execution."""

    outputs: tuple[str, ...] = ()
    degree: int = 0
    rows: list[tuple[Any, list[Any], list[Any], Any, list[list[Any]]]] = field(default_factory=list)
    arcs: list[Arc] = field(default_factory=list)
    transitions: list[Transition] = field(default_factory=list)

    def arc(self, mode, states, jump, rows, kind="flow"):
        """Add an arc; each row is (time, values, outputs, depth, coefficients by power)."""
        first = len(self.rows)
        self.rows += rows
        self.arcs.append(Arc(mode, tuple(states), kind, jump, first, len(self.rows) - 1))

    def transition(self, time, resumed, edge, source, target, before, after, alternatives=(), entry=False):
        """Add a transition."""
        index = len(self.transitions)
        self.transitions.append(
            Transition(index, time, resumed, edge, source, target, before, after, tuple(alternatives), entry)
        )

    def make(self, reason="until", message="The run reached its end.", digits=None, **fields) -> Execution:
        """Close the execution."""
        width = max(len(arc.states) for arc in self.arcs)
        kind = float if digits is None else object
        n = len(self.rows)
        times = np.array([row[0] for row in self.rows], dtype=kind)
        values = np.full((n, width), NAN, dtype=kind)
        outputs = np.full((n, len(self.outputs)), NAN, dtype=kind)
        depth = np.array([row[3] for row in self.rows], dtype=kind)
        coefficients = np.full((n, self.degree, width), NAN, dtype=kind)
        for i, (_, state, output, _, powers) in enumerate(self.rows):
            values[i, : len(state)] = state
            outputs[i, :] = output
            for m, vector in enumerate(powers):
                coefficients[i, m, : len(vector)] = vector
        last = self.arcs[-1]
        state = dict(zip(last.states, values[-1].tolist()[: len(last.states)], strict=True))
        final = Point(
            times.tolist()[-1], last.mode, last.jump, last.kind, state,
            dict(zip(self.outputs, outputs[-1].tolist(), strict=True)),
        )  # fmt: skip
        common = {
            "model": "models/hand-made.yaml",
            "digest": "0" * 64,
            "engine": "python",
            "scheme": "relaxed",
            "method": "midpoint",
            "settings": {"until": times.tolist()[-1], "step": 1e-3, "relaxation": 1e-6, "tolerance": None},
            "verdict": Verdict("unknown", ("nothing checks the hypotheses yet",)),
            "seconds": {"load": 0.25, "compile": 0.01, "simulate": 0.5},
        }
        return Execution(
            **(common | fields), stop=Stop(reason, final.time, message), transitions=tuple(self.transitions),
            final=final, output_names=self.outputs, times=times, values=values, outputs=outputs, depth=depth,
            coefficients=coefficients, arcs=tuple(self.arcs), digits=digits,
        )  # fmt: skip


def bouncing_ball(bounces=4, wait=0.0, convert=float, digits=None, restitution="0.5", height=2, pieces=2):
    """A ball with h' = v, v' = -1 from (height, 0): flights of ``pieces`` rows' parabolas, strips of length ``wait``.

    The state at time t is exact: on a flight from (t0, h0, v0), h = h0 + v0 s - s^2/2, v = v0 - s. Every number is a
    dyadic rational for the defaults, so that comparisons may be exact.
    """
    c = convert(restitution)
    wait = convert(wait)
    draft = Draft(("energy",), degree=2)
    t, h, v = convert(0), convert(height), convert(0)
    sqrt = math.sqrt if digits is None else h.context.sqrt
    for jump in range(bounces + 1):
        flight = v + sqrt(v * v + 2 * h)
        rows = []
        dt = flight / pieces
        for k in range(pieces + 1):
            s = dt * k
            at = [h + v * s - s * s / 2, v - s]
            if k == pieces:
                at[0] = convert(0)
            rows.append((t + s, at, [at[0] + at[1] ** 2 / 2], convert(0), [[at[1] * dt, -dt], [-dt * dt / 2, dt * 0]]))
        draft.arc("fly", ("h", "v"), jump, rows)
        t, h, v = rows[-1][0], convert(0), rows[-1][1][1]
        if jump == bounces:
            break
        reached, still = t, ([h, v], [v * v / 2])
        if wait:
            depths = [convert(0), wait / 4, wait]
            draft.arc("fly", ("h", "v"), jump, [(t + d, *still, d, []) for d in depths], "strip")
            t = t + wait
        draft.transition(reached, t, "bounce", "fly", "fly", {"h": h, "v": v}, {"h": h, "v": -c * v})
        v = -c * v
    return draft.make(digits=digits, title="Bouncing ball")


def modes_of_different_size():
    """A walk through modes with different states, three transitions at t = 1, and a final mode of one row.

    a: x = t, y = 10 - t. At t = 1: a -> b (z := 5), b -> c at once (drops x, y), c -> a at once (x := 7, y := 8);
    then x = 7 + (t - 1), y = 8 - (t - 1) until t = 3, where the final mode is entered with (y, w). The output `double`
    is 2 z where there is a z.
    """
    draft = Draft(("double",), degree=1)
    draft.arc("a", ("x", "y"), 0, [(0.0, [0.0, 10.0], [NAN], 0.0, [[1.0, -1.0]]), (1.0, [1.0, 9.0], [NAN], 0.0, [])])
    draft.transition(1.0, 1.0, "a->b", "a", "b", {"x": 1.0, "y": 9.0}, {"x": 1.0, "y": 9.0, "z": 5.0}, ("a->c",))
    draft.arc("b", ("x", "y", "z"), 1, [(1.0, [1.0, 9.0, 5.0], [10.0], 0.0, [])])
    draft.transition(1.0, 1.0, "b->c", "b", "c", {"x": 1.0, "y": 9.0, "z": 5.0}, {"z": 6.0}, entry=True)
    draft.arc("c", ("z",), 2, [(1.0, [6.0], [12.0], 0.0, [])])
    draft.transition(1.0, 1.0, "c->a", "c", "a", {"z": 6.0}, {"x": 7.0, "y": 8.0})
    draft.arc("a", ("x", "y"), 3, [(1.0, [7.0, 8.0], [NAN], 0.0, [[2.0, -2.0]]), (3.0, [9.0, 6.0], [NAN], 0.0, [])])
    draft.transition(3.0, 3.0, "a->end", "a", "end", {"x": 9.0, "y": 6.0}, {"y": 6.0, "w": -1.0})
    draft.arc("end", ("y", "w"), 4, [(3.0, [6.0, -1.0], [NAN], 0.0, [])])
    return draft.make("final", "The run entered the final mode end.")


def jumping_input():
    """A state with x' = u, u = 1 before t = 1 and -1 after: one mode, no transition, two arcs; the output `u` jumps."""
    draft = Draft(("u",), degree=0)
    draft.arc("m", ("x",), 0, [(0.0, [0.0], [1.0], 0.0, []), (1.0, [1.0], [1.0], 0.0, [])])
    draft.arc("m", ("x",), 0, [(1.0, [1.0], [-1.0], 0.0, []), (2.0, [0.0], [-1.0], 0.0, [])])
    return draft.make()


def ends_in_strip():
    """A state x = t that reaches the guard x >= 1 at t = 1 and the run ends at 1.5, inside the strip of length 2."""
    draft = Draft((), degree=0)
    draft.arc("m", ("x",), 0, [(0.0, [0.0], [], 0.0, []), (1.0, [1.0], [], 0.0, [])])
    draft.arc("m", ("x",), 0, [(1.0, [1.0], [], 0.0, []), (1.5, [1.0], [], 0.5, [])], "strip")
    draft.transition(1.0, None, "go", "m", "n", {"x": 1.0}, None)
    return draft.make(message="The run ended inside a strip.")


def blow_up():
    """A state x = 1/(1 - t), recorded until it is no longer finite."""
    draft = Draft((), degree=0)
    times = [0.0, 0.5, 0.9, 0.99, 0.999, 1 - 1e-6, 1 - 1e-9, 1 - 1e-12]
    rows = [(t, [1 / (1 - t), 2.0], [], 0.0, []) for t in times] + [(1.0, [math.inf, NAN], [], 0.0, [])]
    draft.arc("m", ("x", "y"), 0, rows)
    return draft.make("not_finite", "x**2 is not finite.")


def thermostat(switches, heats="on", cools="off"):
    """A temperature with T' = +-1 between 0 and 1, one row at each end of each arc."""
    draft = Draft((), degree=0)
    for j in range(switches + 1):
        mode, low, high = (heats, 0.0, 1.0) if j % 2 == 0 else (cools, 1.0, 0.0)
        draft.arc(mode, ("T",), j, [(float(j), [low], [], 0.0, []), (float(j + 1), [high], [], 0.0, [])])
        if j < switches:
            after = cools if mode == heats else heats
            draft.transition(float(j + 1), float(j + 1), f"{mode}->{after}", mode, after, {"T": high}, {"T": high})
    return draft.make()


EVERY = (bouncing_ball, modes_of_different_size, jumping_input, ends_in_strip, blow_up)
