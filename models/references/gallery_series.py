"""Exact executions of the gallery by Taylor series: the Lorenz system with a section, stick-slip on a belt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hsdsl.engine.execution import Execution, Verdict
from references.by_series import by_series
from references.interpolation import mp
from references.series import Series, States
from references.taylor import Edge, Mode

SLIDING = "(sliding)"


def lorenz_section() -> Execution:
    """The Lorenz system (10, 28, 8/3) from (1, 1, 20), with the plane z = 27 passed in both directions."""

    def flow(s: States) -> Mapping[str, Series]:
        x, y, z = s["x"], s["y"], s["z"]
        return {"x": 10 * (y - x), "y": x * (28 - z) - y, "z": x * y - z * (mp.mpf(8) / 3)}

    up = Edge("up", "above", lambda s: s["z"] - 27)
    down = Edge("down", "below", lambda s: 27 - s["z"])
    modes = {"below": Mode(("x", "y", "z"), flow, (up,)), "above": Mode(("x", "y", "z"), flow, (down,))}
    return by_series("lorenz-section", "The Lorenz system with a section", modes, "below", (1, 1, 20), 10, "0.01")


def stick_slip() -> Execution:
    """A mass that a belt carries until the spring pulls it back, with sticking as a mode of its own."""
    static, kinetic, belt = mp.mpf("0.4"), mp.mpf("0.2"), mp.mpf("0.1")
    fades = Series.constant(static - kinetic)

    def slip(s: States) -> Mapping[str, Series]:
        return {"x": s["v"], "v": kinetic - s["x"] + fades / (1 + belt - s["v"])}

    def stick(s: States) -> Mapping[str, Series]:
        return {"x": Series.constant(belt), "v": Series.constant(0)}

    catches_up = Edge("catches_up", SLIDING, lambda s: s["v"] - belt, lambda s: {"v": belt + s["v"] * 0})
    slips = Edge("slips", "slower", lambda s: s["x"] - static)
    modes = {"slower": Mode(("x", "v"), slip, (catches_up,)), SLIDING: Mode(("x", "v"), stick, (slips,))}
    run = by_series("stick-slip", "Stick-slip on a belt", modes, "slower", (0, 0), 20, "0.05")
    return replace(run, verdict=Verdict("left", ("it slides along v = belt",)))
