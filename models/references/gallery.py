"""Exact executions of the scenes of ``models/gallery``, by name: equations by hand, solved without the simulator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

from hsdsl.engine.execution import Execution, Verdict
from references.closed_form import ClosedForm, as_execution
from references.gallery_balls import BALLS
from references.gallery_series import lorenz_section, stick_slip
from references.gallery_swings import SWINGS
from references.interpolation import Number, Stretch, mp
from references.terms import exponential, polynomial, stretch

SLIDING = "(sliding)"  # the mode of an arc along a surface, which the model as written does not have
HOLDS = Verdict("holds", ())
Stretches = list[Stretch]


def _exact(name: str, states: dict[str, tuple[str, ...]], found: Stretches, source: str = "closed form") -> Execution:
    left = "left" if any(each.mode == SLIDING for each in found) else "holds"
    verdict = Verdict(left, ("it slides along a surface",)) if left == "left" else HOLDS
    return as_execution(ClosedForm(f"{name}.yaml", name, source, states, found, verdict, 8))


def relay() -> Execution:
    """Along x = 0 from t = 1 on, where the share 1/4 of `negative` keeps x at zero."""
    one = stretch("positive", mp.zero, mp.one, (polynomial(1, -1), polynomial(0)))
    two = stretch(SLIDING, mp.one, mp.mpf(3), (polynomial(0), polynomial(0, mp.mpf(1) / 2)))
    return _exact("relay", dict.fromkeys(("positive", "negative", SLIDING), ("x", "y")), [one, two])


def fast_clock() -> Execution:
    """A thousand ticks: straight lines whose slope is the value at the last tick."""
    T, found, value = mp.mpf("1e-3"), Stretches(), mp.one
    for k in range(1001):
        end = T * (k + 1) if k < 1000 else 1 + T / 2
        functions = (polynomial(value, -value), polynomial(value), polynomial(0, 1))
        found.append(stretch("run", T * k, end, functions, "tick" if k < 1000 else None))
        value *= 1 - T
    return _exact("fast-clock", {"run": ("x", "u", "c")}, found)


def blow_up() -> Execution:
    """1/(1 - t), to a thousandth before the pole, in stretches that each halve the way left."""
    cuts = [mp.zero, *(1 - mp.mpf(2) ** -k for k in range(1, 10)), mp.mpf("0.999")]

    def part(begin: Number, end: Number) -> Stretch:
        def at(t: Number) -> tuple[Number, ...]:
            return 1 / (1 - t), t

        def bounds(n: int) -> tuple[Number, ...]:
            return mp.factorial(n) / (1 - end) ** (n + 1), mp.one if n == 1 else mp.zero

        return Stretch("grow", begin, end, at(begin), at(end), at, bounds)

    return _exact("blow-up", {"grow": ("x", "y")}, [part(*pair) for pair in pairwise(cuts)])


def draining_tank() -> Execution:
    """(1 - t/2)^2, then empty."""
    full = stretch("drains", mp.zero, mp.mpf(2), (polynomial(1, -1, mp.mpf(1) / 4),), "runs_dry")
    empty = stretch("empty", mp.mpf(2), mp.mpf(3), (polynomial(0),))
    return _exact("draining-tank", {"drains": ("h",), "empty": ("h",)}, [full, empty])


def kinked_input() -> Execution:
    """The threshold 2 - 1.501 t meets 1/2 at 1 - 1/1501."""
    t = 1 - mp.one / 1501
    wait = stretch("watch", mp.zero, t, (polynomial(mp.mpf(1) / 2),), "alarm")
    rise = stretch("alarmed", t, mp.mpf(3), (polynomial(mp.mpf(1) / 2, 1),))
    return _exact("kinked-input", {"watch": ("x",), "alarmed": ("x",)}, [wait, rise])


def narrow_pulse() -> Execution:
    """The integral of a Gauss pulse; bounds by Cramér's inequality for Hermite polynomials."""
    w, centre = mp.mpf("1e-3"), mp.mpf(5)

    def at(t: Number) -> tuple[Number, ...]:
        return (mp.sqrt(mp.pi) / 2 * mp.erfc((centre - t) / w),)

    def part(begin: Number, end: Number, edge: str | None = None) -> Stretch:
        near = 0 if begin < centre < end else min(abs(begin - centre), abs(end - centre)) / w

        def bounds(n: int) -> tuple[Number, ...]:
            size = mp.mpf("1.1") * mp.sqrt(mp.mpf(2) ** n * mp.factorial(n)) * mp.exp(-(near**2) / 2)
            return (size / w ** max(n, 1),)

        return Stretch("wait", begin, end, at(begin), at(end), at, bounds, edge)

    full = centre + w * mp.erfinv(2 / mp.sqrt(mp.pi) - 1)
    cuts = [mp.zero, centre - 16 * w, centre - 8 * w, centre - 4 * w, full]
    found = [part(*pair) for pair in pairwise(cuts)]
    found[-1] = replace(found[-1], edge="full", last=(mp.one,))
    found.append(stretch("done", full, mp.mpf(10), (polynomial(1),)))
    return _exact("narrow-pulse", {"wait": ("x",), "done": ("x",)}, found)


def two_ways(edge: str = "side") -> Execution:
    """One of the two limits: the guard `side` first, or `top`."""
    k, one, two = mp.mpf(1) / 2, mp.one, mp.mpf(2)
    first = (polynomial(0, 1), exponential(-1, k, 2 * mp.exp(-k) - 1))
    other = "top" if edge == "side" else "side"
    begin = stretch("start", mp.zero, one, first, edge, last=(one, one), alternatives=(other,))
    ends = {
        "side": ("a", (exponential(1, -1, 0), exponential(0, -2, 1))),
        "top": ("b", (exponential(0, k, 1), exponential(0, 1, -1))),
    }
    mode, functions = ends[edge]
    run = _exact(
        "two-ways", dict.fromkeys(("start", "a", "b"), ("x", "y")), [begin, stretch(mode, one, two, functions)]
    )
    return replace(run, verdict=Verdict("left", ("both guards are met at t = 1, and lead to different points",)))


GALLERY: dict[str, Callable[[], Execution]] = {
    **BALLS,
    **SWINGS,
    "relay": relay,
    "fast-clock": fast_clock,
    "blow-up": blow_up,
    "draining-tank": draining_tank,
    "kinked-input": kinked_input,
    "narrow-pulse": narrow_pulse,
    "lorenz-section": lorenz_section,
    "stick-slip": stick_slip,
    "two-ways": two_ways,
}
"""By the name of a scene's file."""
