"""Motion along guards in any units of guards, of each state and of time."""

from __future__ import annotations

import re
from functools import cache

import pytest
from engines import ENGINES

import hsdsl
from hsdsl.engine.execution import Execution

# a ball that bounces and rolls, one on it, and a puck in a bowl: states, guards and resets in units of their own
SCENES = {  # flow, guards with resets, start, until
    "ball": ({"h": "v", "v": "-9.81", "x": "w", "w": "0"}, {"h": {"v": "-0.6*v"}}, (0.7, 0, 0, 0.4), 3),
    "kinked": ({"h": "v", "v": "-9.81"}, {"h": {"v": "max(-0.3*v, 0)"}}, (0.4, -1), 2),
    "column": (
        {"h": "v", "v": "-9.81", "k": "w", "w": "-9.81"},
        {"h": {"v": "-0.2*v"}, "k - h": {"v": "(v + w)/2", "w": "(v + w)/2"}},
        (0.2, 0, 0.5, 0),
        2,
    ),
    "bowl": (
        {"x": "u", "y": "v", "u": "-u/5", "v": "-9.81 - v/5"},
        {"y - x**2": {"u": "u - 1.2*(2*x*u - v)*2*x/(1 + 4*x**2)", "v": "v + 1.2*(2*x*u - v)/(1 + 4*x**2)"}},
        (0.5, 0.6, 0, 0),
        2,
    ),
}


def scaled(scene: str, guard: float, time: float, *units: float) -> hsdsl.Model:
    """A scene with its numbers in other units."""
    flow, edges, start, until = SCENES[scene]
    unit = dict(zip(flow, units, strict=False))

    def written(text: str) -> str:
        """An expression of values in units, by their numbers."""
        return re.sub(r"\b[hvxwkuy]\b", lambda found: f"({found[0]}/{unit[found[0]]!r})", text)

    def rows(values: dict[str, str], per: float) -> str:
        return "{" + ", ".join(f"{x}: '{unit[x] / per!r}*({written(value)})'" for x, value in values.items()) + "}"

    transitions = "".join(
        f"      - {{when: '{guard!r}*({written(surface)}) <= 0', to: m, reset: {rows(reset, 1)}}}\n"
        for surface, reset in edges.items()
    )
    initial = ", ".join(f"{x}: {value * unit[x]!r}" for x, value in zip(flow, start, strict=True))
    return hsdsl.loads(
        f"hsdsl: 1\nmodes:\n  m:\n    flow: {rows(flow, time)}\n    transitions:\n{transitions}"
        f"initial: {{mode: m, {initial}}}\nexperiment: {{until: {until * time!r}, relaxation: {1e-6 * time!r}}}\n"
    )


@cache
def plain_run(scene: str, engine: str) -> Execution:
    return scaled(scene, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0).simulate(engine=engine)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize(
    "guard, time, units",
    [
        (3e-12, 1, (1, 1, 1, 1)),
        (7e12, 1, (1, 1, 1, 1)),
        (1, 2e-12, (1, 1, 1, 1)),
        (1, 1e12, (1, 1, 1, 1)),
        (1, 1, (1e-12, 1e12, 3e-11, 1e9)),
        (1e-12, 1e9, (1e12, 1e-7, 1, 5e12)),
        (1e12, 1e-9, (1e-12, 1e-12, 1e12, 1e-12)),
    ],
)
def test_motion_along_guards_in_any_units(scene, guard, time, units, engine) -> None:
    plain = plain_run(scene, engine)
    run = scaled(scene, guard, time, *units).simulate(engine=engine)
    assert plain.stop.reason == run.stop.reason == "until"
    assert len(run.transitions) < 100
    for name, unit in zip(plain.final.state, units, strict=False):
        assert run.final.state[name] / unit == pytest.approx(plain.final.state[name], rel=1e-6, abs=1e-7), name
