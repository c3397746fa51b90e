"""Models solved by a formula: bouncing ball, thermostat, digital control system."""

from __future__ import annotations

import mpmath as mp


def ball_bounces(g: mp.mpf, height: mp.mpf, e: mp.mpf, count: int) -> list[tuple[mp.mpf, mp.mpf]]:
    """Times and velocities before the first bounces of a ball dropped from rest: flights take 2 v/g."""
    t, v = mp.sqrt(2 * height / g), mp.sqrt(2 * g * height)
    bounces = []
    for _ in range(count):
        bounces.append((t, -v))
        v = e * v
        t = t + 2 * v / g
    return bounces


def thermostat_switches(count: int) -> list[mp.mpf]:
    """Times at which a thermostat of rate 0.1 between 18 and 22 switches, heater 30, outside 10, from 20 and heating.

    Up from x to 22 takes 10 log((30 - x)/8), down from 22 to 18 takes 10 log(12/8), as up from 18 to 22.
    """
    first = 10 * mp.log(mp.mpf(10) / 8)
    return [first + k * 10 * mp.log(mp.mpf(12) / 8) for k in range(count)]


def digital_control(dx: mp.mpf, dy: mp.mpf) -> tuple[mp.mpf, mp.mpf]:
    """State at t = 2 of the digital control system from (-1 - dx, -1 - dy), one of dx, dy being 0."""
    if dx > 0:
        return 1 - dx, 1 - dx / 5
    return 1 - 3 * dy / 10, 1 - dy
