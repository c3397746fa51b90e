"""Models of parts against the same scenes written out by hand, and solved by SciPy with its own events."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hsdsl

MODELS = Path(__file__).parents[2] / "models" / "parts"
Guards = Callable[[list], list]  # of modes: pairs of a surface function, which rises, and a jump


def followed(flow, guards: Guards, until: float, modes: list, x: list) -> tuple[list[float], np.ndarray, list]:
    """Times of all events, the last state and the last modes; a jump changes modes and state in place."""
    times, t, state = [], 0.0, np.array(x, float)
    while t < until:
        found = guards(modes)
        events = []
        for surface, _ in found:
            events.append(lambda t, x, surface=surface: surface(t, x))
            events[-1].terminal, events[-1].direction = True, 1
        run = solve_ivp(flow, (t, until), state, "DOP853", events=events, args=(), rtol=1e-11, atol=1e-12)
        t, state = run.t[-1], run.y[:, -1].copy()
        if run.status != 1:
            break
        times.append(t)
        for which, (_, jump) in enumerate(found):
            if len(run.t_events[which]):
                jump(modes, state)
    return times, state, modes


def test_three_rooms():
    modes = ["on"] * 3

    def flow(t, T):
        beside = np.array([5.0, *T, 5.0])
        heat = [28 + i if mode == "on" else 0.0 for i, mode in enumerate(modes, start=1)]
        return heat - 0.5 * (T - 5) + 0.25 * (beside[:-2] - T) + 0.25 * (beside[2:] - T)

    def guards(modes):
        def switch(i):
            def jump(modes, T):
                modes[i] = "off" if modes[i] == "on" else "on"

            return jump

        return [
            ((lambda t, T, i=i: T[i] - 21) if modes[i] == "on" else (lambda t, T, i=i: 19 - T[i]), switch(i))
            for i in range(3)
        ]

    run = hsdsl.load(MODELS / "rooms.yaml").simulate(until=2)
    times, T, last = followed(flow, guards, 2.0, modes, [19.25, 19.5, 19.75])
    assert len(times) > 30
    assert [t.time for t in run.transitions] == pytest.approx(times, abs=1e-8)
    assert list(run.final.state.values()) == pytest.approx(T.tolist(), abs=1e-8)
    assert run.final.outputs["heating"] == last.count("on")


def test_chain_with_stops():
    n = 20

    def flow(t, y):
        x, v = y[:n], y[n:]
        beside = np.concatenate(([0.0], x, [0.0]))
        return np.concatenate((v, 100 * (beside[:-2] - 2 * x + beside[2:]) - 0.1 * v))

    def guards(modes):
        def bounce(i):
            def jump(modes, y):
                y[n + i] *= -0.8

            return jump

        return [(lambda t, y, i=i: y[i] - 0.5, bounce(i)) for i in range(n)]

    k = np.arange(1, n + 1)
    start = [0.0] * n + list(6 * np.sin(np.pi * k / 21) + 2 * np.sin(2 * np.pi * k / 21))
    run = hsdsl.load(MODELS / "chain.yaml").simulate()
    times, y, _ = followed(flow, guards, 1.0, [], start)
    assert len(times) > 10
    assert [t.time for t in run.transitions] == pytest.approx(times, abs=1e-7)
    assert [run.final.state[f"mass[{i}].x"] for i in k] == pytest.approx(y[:n].tolist(), abs=1e-6)


def test_balls_come_to_rest():
    """A ball from height h rests after sqrt(2h/g) (1 + e)/(1 - e), and rolls on."""
    run = hsdsl.load(MODELS / "balls.yaml").simulate()
    for i in (1, 2, 3):
        first = np.sqrt(2 * (i / 4) / 9.81)
        bounces = [t.time for t in run.transitions if t.edge == f"ball[{i}].bounce"]
        exact = [first * (1 + 2 * sum(0.5**j for j in range(1, k + 1))) for k in range(len(bounces))]
        assert bounces == pytest.approx(exact, abs=1e-9)
        assert bounces[-1] == pytest.approx(3 * first, abs=1e-5)
        assert run.final.state[f"ball[{i}].x"] == pytest.approx(2 * i, abs=1e-9)
        assert abs(run.final.state[f"ball[{i}].h"]) < 1e-12


def test_platoon_shifts_gears():
    modes = [1] * 6
    factor = {1: 1.0, 2: 0.8, 3: 0.6}

    def flow(t, y):
        lead = 12 + 6 * np.sin(t / 3)
        slopes = [lead]
        front, speed = y[0], lead
        for i in range(6):
            x, v = y[1 + 2 * i], y[2 + 2 * i]
            expected = (front - x - 10 - v) / 5 + 0.6 * (speed - v)
            slopes += [v, factor[modes[i]] * (1 + (i + 1) / 20) * expected]
            front, speed = x, v
        return np.array(slopes)

    def guards(modes):
        def shift(i, by):
            def jump(modes, y):
                modes[i] += by

            return jump

        found = []
        for i, gear in enumerate(modes):
            if gear < 3:
                found.append((lambda t, y, i=i, s=9 if gear == 1 else 15: y[2 + 2 * i] - s, shift(i, 1)))
            if gear > 1:
                found.append((lambda t, y, i=i, s=7 if gear == 2 else 13: s - y[2 + 2 * i], shift(i, -1)))
        return found

    start = [0.0] + [value for i in range(1, 7) for value in (-15.0 * i, 5.0)]
    run = hsdsl.load(MODELS / "platoon.yaml").simulate()
    times, y, last = followed(flow, guards, 30.0, modes, start)
    assert len(times) > 20
    assert [t.time for t in run.transitions] == pytest.approx(times, abs=1e-7)
    assert run.final.outputs["gears"] == sum(last)
    assert run.final.state["car[6].x"] == pytest.approx(y[11], abs=1e-6)


def test_the_centipede_walks_as_one_written_by_hand():
    n, reach = 20, 0.3
    modes = [0] * n  # 0: swings, with s ahead of the hip; 1: stands, with its foot

    def flow(t, y):
        x, v, z, w, own = y[0], y[1], y[2], y[3], y[4:]
        ahead = own - x
        stands = np.array(modes) == 1
        push = np.where(stands, 12 * (1 - ahead / 0.6) / 20, 0.0).sum()
        lift = np.where(stands, 20 * (1 - z + 2 * 20 * 9.81 / 400), 0.0).sum()
        speeds = np.where(stands, 0.0, 1.6 + np.arange(1, n + 1) / 100)
        return np.concatenate(([v, (push - 8 * v) / 20, w, lift / 20 - 9.81 - 2 * w], speeds))

    def guards(modes):
        def step(i):
            def jump(modes, y):
                modes[i] = 1 - modes[i]
                y[4 + i] += y[0] if modes[i] else -y[0]

            return jump

        return [
            ((lambda t, y, i=i: y[0] - y[4 + i] - reach) if modes[i] else (lambda t, y, i=i: y[4 + i] - reach), step(i))
            for i in range(n)
        ]

    start = [0.0, 1.0, 1.0, 0.0] + [reach * (2 * (i - 0.5) / 20 - 1) for i in range(1, n + 1)]
    run = hsdsl.load(MODELS / "centipede.yaml").simulate(until=0.5)
    times, y, last = followed(flow, guards, 0.5, modes, start)
    assert len(times) > 15
    assert [t.time for t in run.transitions] == pytest.approx(times, abs=1e-8)
    assert [run.final.state[f"body.{name}"] for name in "xvzw"] == pytest.approx(y[:4].tolist(), abs=1e-8)
    assert run.final.outputs["standing"] == sum(last)


def test_compass_walkers_walk_as_with_a_matrix_solver():
    """A known gait: on a slope of 3 degrees a step takes 0.734 s (Goswami et al.)."""
    m, mh, a, b, long, g = 5.0, 10.0, 0.5, 0.5, 1.0, 9.81

    def flow(t, y):
        n, s, wn, ws = y
        between = m * long * b * np.cos(s - n)
        mass = np.array([[m * b**2, -between], [-between, (mh + m) * long**2 + m * a**2]])
        turning = m * long * b * np.sin(s - n) * np.array([ws**2, -(wn**2)])
        weight = np.array([m * b * g * np.sin(n), -(mh * long + m * a + m * long) * g * np.sin(s)])
        return np.concatenate(([wn, ws], np.linalg.solve(mass, -turning - weight)))

    def impact(modes, y):
        n, s, wn, ws = y
        c = np.cos(s - n)
        after = [
            [m * b**2 - m * b * long * c, m * long**2 + m * a**2 + mh * long**2 - m * b * long * c],
            [m * b**2, -m * b * long * c],
        ]
        before = np.array([[-m * a * b, -m * a * b + (mh * long**2 + 2 * m * a * long) * c], [0.0, -m * a * b]])
        y[:] = [s, n, *np.linalg.solve(np.array(after), before @ [wn, ws])]

    run = hsdsl.load(MODELS / "compass-walker.yaml").simulate()
    starts = {"steep": (1.0, [-0.3234, 0.2187, -0.3772, -1.0918]), "flat": (5 / 6, [-0.31, 0.2227, -0.38, -1.05])}
    for name, (slope, start) in starts.items():

        def guards(modes, slope=slope):
            # past the other leg the surface falls through zero; before that it is crossed the other way
            return [(lambda t, q: -(q[0] + q[1] + slope * np.pi / 30) if q[0] > q[1] else -1.0, impact)]

        times, y, _ = followed(flow, guards, 4.0, [], start)
        made = [t.time for t in run.transitions if t.edge == f"{name}.impact"]
        assert len(made) >= 5
        assert made == pytest.approx(times, abs=1e-7)
        assert list(run.final.state.values())[0 if name == "steep" else 4 :][:4] == pytest.approx(y.tolist(), abs=1e-5)
    steps = np.diff([t.time for t in run.transitions if t.edge == "steep.impact"])
    assert steps[-1] == pytest.approx(0.734, abs=2e-3)
