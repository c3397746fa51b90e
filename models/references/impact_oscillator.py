"""The forced linear oscillator with stop (Burden et al. 2013, Section V-B), solved piece by piece in closed form.

x'' + 2 a x' + omega^2 x = A cos(omega t), a stop at x <= x_max, velocity v -> -c v at an impact. The force is at
resonance in both examples, so the particular solution is A/(2 a omega) sin(omega t). Impacts are roots of the closed
form, found on a grid and polished in high precision. At rest on the stop the mass sticks while the force presses on
it, A cos(omega t) >= omega^2 x_max (unit mass); an infinity of impacts before that is summed to its limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from hsdsl.engine.execution import Array
from references.interpolation import Number, Vector, mp

REST = mp.mpf(10) ** -25  # impacts slower than this are summed; flights down to it cancel half of the digits


@dataclass(frozen=True)
class Oscillator:
    """Parameters of the equation, as decimal text."""

    a: str
    c: str
    omega: str
    x_max: str
    amplitude: str

    def number(self, name: str) -> Number:
        """A parameter in high precision."""
        return mp.mpf(getattr(self, name))


@dataclass(frozen=True)
class Flight:
    """x = B sin(omega t) + exp(-a s) (C cos(wd s) + S sin(wd s)), s = t - start."""

    start: Number
    a: Number
    omega: Number
    damped: Number
    forced: Number
    cosine: Number
    sine: Number

    @classmethod
    def of(cls, oscillator: Oscillator, start: Number, x: Number, v: Number) -> Flight:
        """The flight that begins at (x, v): initial values less the particular solution's."""
        a, omega = oscillator.number("a"), oscillator.number("omega")
        forced = oscillator.number("amplitude") / (2 * a * omega)
        damped = mp.sqrt(omega**2 - a**2)
        cosine = x - forced * mp.sin(omega * start)
        sine = (v - forced * omega * mp.cos(omega * start) + a * cosine) / damped
        return cls(start, a, omega, damped, forced, cosine, sine)

    def at(self, t: Any, m: Any = mp) -> tuple[Any, Any]:
        """Position and velocity at time t; ``m`` is the module that has sin, cos and exp (mpmath or numpy)."""
        number = mp.mpf if m is mp else float
        start, a, omega, damped, forced, cosine, sine = (number(y) for y in self.__dict__.values())
        s = t - start
        decay, co, si = m.exp(-a * s), m.cos(damped * s), m.sin(damped * s)
        x = forced * m.sin(omega * t) + decay * (cosine * co + sine * si)
        v = forced * omega * m.cos(omega * t) + decay * (
            (damped * sine - a * cosine) * co - (damped * cosine + a * sine) * si
        )
        return x, v

    def derivative(self, n: int) -> Vector:
        """Bounds on the n-th derivatives: every part is a multiple of exp(q t) with |q| = omega, and none grows."""
        size = (abs(self.forced) + mp.hypot(self.cosine, self.sine)) * self.omega**n
        return size, size * self.omega


@dataclass(frozen=True)
class Impact:
    """An impact: its time and the velocity before it."""

    time: Number
    velocity: Number


class Motion:
    """An exact solution: ``impacts``, ``zeno`` (times), ``released`` (times), and ``at(t)`` for floats or arrays."""

    def __init__(self, oscillator: Oscillator, x: Number, v: Number, until: Number) -> None:
        self.oscillator, self.until = oscillator, until
        self.pieces: list[tuple[Number, Flight | None]] = []  # None: stuck
        self.impacts: list[Impact] = []
        self.zeno: list[Number] = []
        self.released: list[Number] = []
        t = mp.mpf(0)
        stop, c = oscillator.number("x_max"), oscillator.number("c")
        while t < until:
            if x == stop and v == 0 and self._pressed(t) >= 0:
                self.pieces.append((t, None))
                t = self._release(t)
                self.released.append(t)
                if t >= until:
                    return
            flight = Flight.of(oscillator, t, x, v)
            self.pieces.append((t, flight))
            hit = self._hit(flight)
            if hit is None:
                return
            t, x, velocity = hit, stop, flight.at(hit)[1]
            self.impacts.append(Impact(t, velocity))
            v = -c * velocity
            if abs(v) < REST and self._pressed(t) > 0:
                # flights of 2 |v|/p each shorter than the last by c: their sum, for a constant pressing force p
                t, v = t + 2 * abs(v) / self._pressed(t) / (1 - c), mp.mpf(0)
                self.zeno.append(t)

    def _pressed(self, t: Number) -> Number:
        o = self.oscillator
        return o.number("amplitude") * mp.cos(o.number("omega") * t) - o.number("omega") ** 2 * o.number("x_max")

    def _release(self, t: Number) -> Number:
        o = self.oscillator
        omega = o.number("omega")
        first = mp.acos(omega**2 * o.number("x_max") / o.number("amplitude")) / omega
        period = 2 * mp.pi / omega
        return first + period * mp.ceil((t - first) / period)

    def _hit(self, flight: Flight) -> Number | None:
        """First time after the start at which the flight is back at the stop."""
        stop = self.oscillator.number("x_max")
        x, v = flight.at(flight.start)
        if x == stop:
            short = self._short(flight, v, stop)
            if short is not None:
                return short
        times = np.arange(float(flight.start) + 1e-3, float(self.until) + 1e-3, 1e-3)
        above = np.flatnonzero(flight.at(times, np)[0] > float(stop))
        if not len(above):
            return None
        low, high = (mp.mpf(float(times[above[0]])) - mp.mpf("1e-3") * k for k in (1, 0))

        def beyond(t: Number) -> Number:
            return flight.at(t)[0] - stop

        root = mp.findroot(beyond, (max(low, flight.start), high), solver="anderson", tol=1e-100)
        return root if root <= self.until else None

    def _short(self, flight: Flight, v: Number, stop: Number) -> Number | None:
        """A flight of less than a tenth: Newton's method on (x - x_max)/s from 2 |v|/p; None where it is longer."""
        pressed = self._pressed(flight.start)
        if v >= 0 or pressed <= 0 or -v / pressed > 0.02:
            return None

        def scaled(s: Number) -> Number:
            return (flight.at(flight.start + s)[0] - stop) / s

        guess = -2 * v / pressed
        return flight.start + mp.findroot(scaled, (guess, guess * mp.mpf("1.01")), tol=1e-90)

    def at(self, times: Any) -> tuple[Any, Any]:
        """Position and velocity at float times, in double precision; at an impact the values after it."""
        moments: Array = np.asarray(times, dtype=float)
        x, v = np.full(moments.shape, float(self.oscillator.number("x_max"))), np.zeros(moments.shape)
        starts: Array = np.array([float(start) for start, _ in self.pieces])
        which: Array = np.asarray(np.searchsorted(starts, moments, side="right")) - 1
        for k, (_, flight) in enumerate(self.pieces):
            here: Array = np.equal(which, k)
            if flight is not None and here.any():
                x[here], v[here] = flight.at(moments[here], np)
        return x, v

    def exactly(self, t: Any) -> tuple[Number, Number]:
        """Position and velocity at one time, in high precision."""
        t = mp.mpf(t)
        _, flight = [piece for piece in self.pieces if piece[0] <= t][-1]
        return flight.at(t) if flight else (self.oscillator.number("x_max"), mp.mpf(0))


@lru_cache
def exact_example_1() -> Motion:
    """Table I, example 1, from (11.36, 31.4) until 40 pi."""
    return Motion(Oscillator("0.05", "0.9", "2.5", "14", "20"), mp.mpf("11.36"), mp.mpf("31.4"), 40 * mp.pi)


@lru_cache
def exact_example_2() -> Motion:
    """Table I, example 2, from rest on the stop until 4 pi; two Zeno points."""
    return Motion(Oscillator("0.95", "0.5", "1", "-0.8", "1"), mp.mpf("-0.8"), mp.mpf(0), 4 * mp.pi)
