"""The pendulum caught by a pin, integrated by Taylor series of order 40 in forty digits.

phi'' = -(g/length) sin phi - (d/m) phi'; the length is 1 where phi >= -pi/12 and 0.3 below; the angular velocity is
divided by 0.3 going in and multiplied by it coming out. Series coefficients follow by recurrence, since with
s = sin phi and c = cos phi we have s' = c phi' and c' = -s phi'. Switches are roots of the series itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import mpmath as mp

DIGITS, ORDER, STEP = 40, 40, "0.05"


@dataclass(frozen=True)
class Switch:
    """A switch: time, the mode it leads to, and the angular velocity before and after."""

    time: mp.mpf
    mode: str
    before: mp.mpf
    after: mp.mpf


def series(phi: mp.mpf, w: mp.mpf, length: mp.mpf) -> tuple[list[mp.mpf], list[mp.mpf]]:
    """Taylor coefficients of phi and phi'."""
    g, damping = mp.mpf("9.81"), mp.mpf("0.2") / mp.mpf("1.02")
    p, v, s, c = [phi], [w], [mp.sin(phi)], [mp.cos(phi)]
    for n in range(ORDER):
        p.append(v[n] / (n + 1))
        v.append((-g / length * s[n] - damping * v[n]) / (n + 1))
        rates = [(k + 1) * p[k + 1] for k in range(n + 1)]
        s.append(mp.fdot(rates, reversed(c)) / (n + 1))
        c.append(-mp.fdot(rates, reversed(s[: n + 1])) / (n + 1))
    return p, v


def value(coefficients: list[mp.mpf], s: mp.mpf) -> mp.mpf:
    """The series at s."""
    return mp.polyval(coefficients[::-1], s)


@lru_cache
def exact_pendulum() -> tuple[tuple[Switch, ...], tuple[mp.mpf, mp.mpf, mp.mpf]]:
    """All switches until t = 10, and (t, phi, phi') at the end."""
    with mp.workdps(DIGITS):
        pin, until, step = -mp.pi / 12, mp.mpf(10), mp.mpf(STEP)
        t, phi, w, mode = mp.mpf(0), mp.pi / 6, mp.mpf(0), "long"
        switches: list[Switch] = []
        while t < until:
            p, v = series(phi, w, mp.mpf(1) if mode == "long" else mp.mpf("0.3"))
            h = min(step, until - t)
            inside = 1 if mode == "long" else -1
            if inside * (value(p, h) - pin) >= 0:
                t, phi, w = t + h, value(p, h), value(v, h)
                continue
            h = mp.findroot(lambda s, p=p: value(p, s) - pin, (h * mp.mpf("0.9"), h), tol=1e-70)
            before = value(v, h)
            t, phi, w = t + h, pin, before * mp.mpf("0.3") if mode == "short" else before / mp.mpf("0.3")
            mode = "short" if mode == "long" else "long"
            switches.append(Switch(t, mode, before, w))
        return tuple(switches), (t, phi, w)
