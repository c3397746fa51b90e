"""Random controllers in discrete time around a pulse-width modulator, and their executions at sixty digits.

At each whole second `sample` sets the clock c to 0 and computes the controller's states and the pulse width d from the
values before; `width` ends the pulse at c >= d. Flows are constant, so the reference needs no integrator: it iterates
the map of one period. Models and reference are made of the same texts; decimals are exact in both.
"""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import mpmath as mp

DIGITS = 60
NUDGE = mp.mpf(10) ** -40  # of the start, relative: what it grows by says how well conditioned an execution is
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True)
class Controller:
    """Texts: resets and starts by state, ``let`` by name in order, and what the pulse width is an affine function of.

    ``plant`` has the slopes of the measured state x in the pulse and behind it. With ``bounded`` the width is limited;
    without, it is scaled so that it needs no limit. ``stages`` says in how many transitions a sample is made.
    """

    reset: Mapping[str, str]
    start: Mapping[str, str]
    signal: str
    let: Mapping[str, str] = field(default_factory=dict[str, str])
    plant: tuple[str, str] = ("0", "0")
    bounded: bool = False
    stages: int = 1


@dataclass(frozen=True)
class Right:
    """An execution: pulse widths d by sample, final states, and how much a change at the start grows."""

    widths: Sequence[Any]
    final: Mapping[str, Any]
    growth: float


def _number(r: random.Random, low: float, high: float, digits: int = 4) -> str:
    return f"{r.uniform(low, high):.{digits}f}"


def _terms(pairs: Iterator[tuple[str, str]]) -> str:
    return " + ".join(f"({a})*{b}" for a, b in pairs)


def _poles(r: random.Random, order: int, most: float) -> list[float]:
    """The coefficients a_1, ... of w = sum a_k w_k, with real and complex poles of at most this size."""
    poly = [1.0]
    while len(poly) <= order:
        size = most * (1 - r.random() ** 2)
        if order - len(poly) >= 1 and r.random() < 0.6:
            factor = [1.0, -2 * size * math.cos(r.uniform(0, math.pi)), size * size]
        else:
            factor = [1.0, size * r.choice((-1, 1))]
        poly = [
            sum(poly[j] * factor[i - j] for j in range(len(poly)) if 0 <= i - j < len(factor))
            for i in range(len(poly) + len(factor) - 1)
        ]
    return [-a for a in poly[1:]]


def transversal_filter(r: random.Random) -> Controller:
    """A filter in direct form of order 1 to 8, free or driven by a constant."""
    order = r.randint(1, 8)
    names = [f"w{i}" for i in range(1, order + 1)]
    a = [f"{v:.8f}" for v in _poles(r, order, r.choice((0.6, 0.8, 0.95, 0.99)))]
    drive = r.choice(("0", _number(r, -1, 1)))
    reset = {"w1": f"{_terms(zip(a, names, strict=True))} + ({drive})"}
    reset |= {names[i]: names[i - 1] for i in range(1, order)}
    return Controller(reset, {n: _number(r, -1, 1) for n in names}, "w1", stages=r.randint(1, 3))


def slow_filter(r: random.Random) -> Controller:
    """A filter of the first or second order with poles of up to 0.999."""
    order = r.randint(1, 2)
    names = [f"w{i}" for i in range(1, order + 1)]
    a = [f"{v:.8f}" for v in _poles(r, order, 0.999)]
    reset = {"w1": _terms(zip(a, names, strict=True))} | ({"w2": "w1"} if order == 2 else {})
    return Controller(reset, {n: _number(r, -1, 1) for n in names}, "w1", stages=r.randint(1, 2))


def biquads(r: random.Random) -> Controller:
    """Sections of the second order in series, each in transposed direct form, behind an oscillator."""
    sections = r.randint(1, 4)
    let: dict[str, str] = {}
    reset = {"o1": f"({_number(r, -1.99, 1.99)})*o1 - o2", "o2": "o1"}
    start = {"o1": _number(r, 0.2, 1), "o2": _number(r, -1, 1)}
    signal = "o1"
    for i in range(1, sections + 1):
        b0, b1, b2 = (_number(r, -0.5, 0.5) for _ in range(3))
        a1, a2 = (f"{-v:.6f}" for v in _poles(r, 2, 0.97)[:2])
        let[f"y{i}"] = f"({b0})*{signal} + s{i}"
        reset |= {f"s{i}": f"({b1})*{signal} - ({a1})*y{i} + r{i}", f"r{i}": f"({b2})*{signal} - ({a2})*y{i}"}
        start |= {f"s{i}": "0", f"r{i}": "0"}
        signal = f"y{i}"
    return Controller(reset, start, signal, let)


def pid(r: random.Random) -> Controller:
    """A controller with integral and filtered derivative of an integrator that the pulses drive."""
    kp, ki, kd = _number(r, 0.1, 0.5), _number(r, 0.01, 0.05), _number(r, 0, 0.1)
    let = {"e": f"{_number(r, -2, 2)} - x"}
    reset = {"i": f"i + {ki}*e", "f": f"{_number(r, 0.1, 0.9)}*f + {kd}*(e - p)", "p": "e"}
    rise = _number(r, 0.5, 1)
    return Controller(
        reset, {"i": "0", "f": "0", "p": "0"}, f"{kp}*e + i + f", let, (rise, f"-{rise}"), bounded=True,
        stages=r.randint(1, 2),
    )  # fmt: skip


def kalman(r: random.Random) -> Controller:
    """An estimator of level and rate with its covariances, and feedback of both."""
    q, noise = _number(r, 0.001, 0.1), _number(r, 0.1, 1)
    let = {
        "a": "p11 + 2*p12 + p22 + " + q, "b": "p12 + p22", "g": "p22 + " + q,
        "k1": f"a/(a + {noise})", "k2": f"b/(a + {noise})", "v": "x - (l + m)",
    }  # fmt: skip
    reset = {
        "l": "l + m + k1*v", "m": "m + k2*v",
        "p11": "(1 - k1)*a", "p12": "(1 - k1)*b", "p22": "g - k2*b",
    }  # fmt: skip
    start = {"l": "0", "m": "0", "p11": "1", "p12": "0", "p22": "1"}
    rise = _number(r, 0.5, 1)
    signal = f"{_number(r, 0.1, 0.4)}*({_number(r, -1, 1)} - l) - {_number(r, 0.05, 0.2)}*m"
    return Controller(reset, start, signal, let, (rise, f"-{rise}"), bounded=True)


def observer(r: random.Random) -> Controller:
    """An observer with constant gains of an integrator that the pulses drive."""
    reset = {"l": f"l + m + {_number(r, 0.2, 0.8)}*(x - l)", "m": f"0.98*m + {_number(r, 0.01, 0.1)}*(x - l)"}
    rise = _number(r, 0.5, 1)
    signal = f"{_number(r, 0.1, 0.4)}*({_number(r, -1, 1)} - l) - {_number(r, 0, 0.2)}*m"
    return Controller(reset, {"l": "0", "m": "0"}, signal, {}, (rise, f"-{rise}"), bounded=True)


def shift_register(r: random.Random) -> Controller:
    """A mean of the last 64 samples of an oscillator, with weights of both signs."""
    names = [f"w{i}" for i in range(1, 65)]
    reset = {"o1": f"({_number(r, -1.99, 1.99)})*o1 - o2", "o2": "o1", "w1": "o1"}
    reset |= {names[i]: names[i - 1] for i in range(1, 64)}
    start = {"o1": _number(r, 0.2, 1), "o2": _number(r, -1, 1)} | dict.fromkeys(names, "0")
    return Controller(reset, start, _terms((_number(r, -1, 1), n) for n in names))


FAMILIES: dict[str, Callable[[random.Random], Controller]] = {
    draw.__name__: draw for draw in (transversal_filter, slow_filter, biquads, pid, kalman, observer, shift_register)
}


def width(controller: Controller, r: random.Random) -> str:
    """The pulse width: a half and a share of the signal, which the first samples of an unbounded one are scaled by."""
    if controller.bounded:
        return f"min(0.9, max(0.1, 0.5 + ({controller.signal})))"
    largest = float(max(abs(v) for v in _signals(controller, 1200)))
    return f"0.5 + {r.uniform(0.1, 0.39) / largest:.6e}*({controller.signal})"


def _signals(controller: Controller, samples: int) -> Iterator[Any]:
    step, read = _step(controller), _code(controller.signal)
    state: dict[str, Any] = {"x": mp.mpf(0)} | {n: mp.mpf(v) for n, v in controller.start.items()}
    for _ in range(samples):
        yield eval(read, _NAMES, _with_lets(controller, state))
        state = state | step(state)


def model_text(controller: Controller, d: str, until: str) -> str:
    """The controller as a model: a sample is made in one transition or handed through modes at one instant."""
    names = ["c", "d", "x", *controller.reset]

    def flow(rise: str) -> str:
        return "{" + ", ".join(f'{n}: "{dict(c="1", x=rise).get(n, "0")}"' for n in names) + "}"

    reset = {"c": "0", "d": d, **controller.reset}
    lines = ["hsdsl: 1"]
    if controller.let:
        lines += ["let:", *(f'  {n}: "{text}"' for n, text in controller.let.items())]
    lines += ["modes:", "  on:", f"    flow: {flow(controller.plant[0])}", "    transitions:"]
    lines += ["      - {name: width, when: c >= d, to: off}"]
    chain = ["off", *(f"stage{i}" for i in range(1, controller.stages)), "on"]
    for i, (here, there) in enumerate(pairwise(chain)):
        last = there == "on"
        texts = ", ".join(f'{n}: "{text}"' for n, text in reset.items()) if last else ""
        lines += [f"  {here}:", f"    flow: {flow(controller.plant[1])}", "    transitions:"]
        lines += [
            f"      - {{name: {'sample' if last else f'hand{i}'}, when: c >= 1, to: {there}, reset: {{{texts}}}}}"
        ]
    start = ", ".join(f"{n}: {v}" for n, v in {"c": "0", "d": "0.5", "x": "0", **controller.start}.items())
    return "\n".join([*lines, f"initial: {{mode: on, {start}}}", f"experiment: {{until: {until}}}", ""])


_NAMES: dict[str, Any] = {"mpf": mp.mpf, "min": min, "max": max, "__builtins__": {}}


def _code(text: str) -> Any:
    return compile(NUMBER.sub(lambda m: f"mpf('{m[0]}')", text), text, "eval")


def _with_lets(controller: Controller, state: Mapping[str, Any]) -> dict[str, Any]:
    known = dict(state)
    for name, text in controller.let.items():
        known[name] = eval(_LETS.setdefault(text, _code(text)), _NAMES, known)
    return known


_LETS: dict[str, Any] = {}


def _step(controller: Controller, d: str = "0") -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    codes = {n: _code(text) for n, text in {**controller.reset, "d": d}.items()}

    def step(state: Mapping[str, Any]) -> dict[str, Any]:
        known = _with_lets(controller, state)
        return {n: eval(code, _NAMES, known) for n, code in codes.items()}

    return step


def right(controller: Controller, d: str, samples: int) -> Right:
    """The execution until so many samples are made and the pulse after the last one has ended."""
    with mp.workdps(DIGITS):
        step, slopes = _step(controller, d), tuple(map(mp.mpf, controller.plant))

        def follow(nudge: Any) -> tuple[list[Any], dict[str, Any]]:
            state: dict[str, Any] = {n: mp.mpf(v) * (1 + nudge) + nudge for n, v in controller.start.items()}
            state |= {"x": mp.mpf(0), "d": mp.mpf("0.5")}
            widths = [state["d"]]
            for _ in range(samples):
                state["x"] = state["x"] + slopes[0] * state["d"] + slopes[1] * (1 - state["d"])
                state |= step(state)
                widths.append(state["d"])
            return widths, state

        widths, final = follow(mp.mpf(0))
        near, _ = follow(NUDGE)
        growth = max(abs(a - b) for a, b in zip(widths, near, strict=True)) / NUDGE
        return Right(widths, final, float(growth))
