"""One state, two, three, one: x' = 2 - x up to 1, a turn of (x, y) up to y = 1, decay until z = 1, x' = -x."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from references.closed_form import ClosedForm, as_execution
from references.interpolation import Number, Stretch, Vector, mp

from hsdsl.engine.execution import Verdict

STATES = {"line": ("x",), "plane": ("x", "y"), "space": ("x", "y", "z"), "last": ("x",)}


def dimensions(of: Any, until: Any = 3) -> Any:
    """The execution from x = 0."""
    verdict = Verdict("holds", ("every surface is crossed at a rate of 1/2 at least",))
    stretches = list(_stretches(mp.mpf(until)))
    form = ClosedForm("dimensions.yaml", "Dimensions", "closed form", STATES, stretches, verdict, 8)
    return replace(as_execution(form), digest=of.program.digest)


def _stretches(until: Number) -> Iterator[Stretch]:
    t, mode, x = mp.zero, "line", (mp.zero,)
    while True:
        at, length = ARCS[mode](x)
        edge, target, reset = JUMPS.get(mode, (None, None, None))
        end = t + length
        after = at(min(end, until) - t)
        sizes = (mp.mpf(3),) * len(x)  # of all derivatives: rates of at most 1, coefficients of at most 3
        bounds = partial(lambda sizes, n: sizes, sizes)
        yield Stretch(mode, t, min(end, until), x, after, shifted(at, t), bounds, edge if end <= until else None)
        if end > until:
            return
        t, mode, x = end, target, reset(after)


def shifted(at: Any, start: Number) -> Any:
    return lambda t: at(t - start)


def line(x: Vector) -> tuple[Any, Number]:
    return lambda s: (2 - (2 - x[0]) * mp.exp(-s),), mp.log(2 - x[0])


def plane(x: Vector) -> tuple[Any, Number]:
    size, angle = mp.hypot(*x), mp.atan2(x[1], x[0])
    return lambda s: (size * mp.cos(angle + s), size * mp.sin(angle + s)), mp.asin(1 / size) - angle


def last(x: Vector) -> tuple[Any, Number]:
    return lambda s: (x[0] * mp.exp(-s),), mp.inf


def space(x: Vector) -> tuple[Any, Number]:
    def at(s: Number) -> Vector:
        return x[0] * mp.exp(-s), x[1] * mp.exp(-s), (1 + x[2]) * mp.exp(-s / 2) - 1

    return at, 2 * mp.log((1 + x[2]) / 2)


ARCS: dict[str, Any] = {"line": line, "plane": plane, "space": space, "last": last}
JUMPS: dict[str, Any] = {
    "line": ("line->plane", "plane", lambda x: (x[0], x[0] / 2)),
    "plane": ("plane->space", "space", lambda x: (*x, 1 + x[0])),
    "space": ("space->last", "last", lambda x: (x[0] + x[1] / 4,)),
}
