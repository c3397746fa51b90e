# pyright: basic, reportCallIssue=false
"""Derivatives of stiff runs, against differences of exact executions: exponentials of matrices in sixty digits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mpmath
import pytest
from engines import needs_compiler

import hsdsl
from hsdsl.engine.execution.records import same

STEP = mpmath.mpf(10) ** -25
SWITCH = hsdsl.load("models/stiff-switch.yaml")
FOLLOWERS = hsdsl.loads("""
hsdsl: 1
parameters: {k: 3e5, a: 1.5, top: 0.9}
modes:
  A:
    flow: {x: 3 - a*x, y: -k*(y - x - z), z: -10*k*(z - x/2)}
    transitions: [{name: up, when: y - 0.1*x >= top, to: B, reset: {y: y - 0.2*z, x: x*0.97}}]
  B:
    flow: {x: -1 - a*x, y: -k/2*(y - x), z: -20*k*(z - y)}
    transitions: [{name: down, when: z <= 0.25, to: A, reset: {z: z*0.5}}]
initial: {mode: A, x: 0.1, y: 0.1, z: 0.02}
experiment: {until: 0.6, method: radau}
""")

COUNTER = hsdsl.loads("""
hsdsl: 1
parameters: {a: 0.8}
modes:
  A:
    flow: {x: 1, y: 0, n: 0}
    transitions: [{name: up, when: x >= a + y, to: A, reset: {x: x - a, y: y + n, n: n + 1}}]
initial: {mode: A, x: 0, y: 0.2, n: 0}
experiment: {until: 1.2}
""")


@dataclass(frozen=True)
class Affine:
    """A mode x' = A x + b that is left where c x = d rises, through x -> R x, for a further mode."""

    a: list[list[Any]]
    b: list[Any]
    c: list[Any]
    d: Any
    reset: list[list[Any]]

    def slope(self, x: Any) -> Any:
        """The flow."""
        return mpmath.matrix(self.a) * x + mpmath.matrix(self.b)

    def solution(self, x: Any) -> Any:
        """The solution from x as a function of time, by the eigenvectors of A."""
        values, vectors = mpmath.eig(mpmath.matrix(self.a))
        share = mpmath.lu_solve(vectors, x + mpmath.lu_solve(mpmath.matrix(self.a), mpmath.matrix(self.b)))
        rest = x - vectors * share

        def at(s: Any) -> Any:
            grown = mpmath.matrix([w * mpmath.exp(v * s) for w, v in zip(share, values, strict=True)])
            return (rest + vectors * grown).apply(mpmath.re)

        return at

    def crossing(self, along: Any, s: Any) -> Any:
        """When it leaves, by Newton's method from s."""
        c = mpmath.matrix(self.c).T
        for _ in range(8):
            x = along(s)
            s -= ((c * x)[0] - self.d) / (c * self.slope(x))[0]
        return s


def executions(modes: list[Affine], x: list[Any], until: Any, guesses: list[float]) -> list[list[Any]]:
    """Time and state right behind each transition, then at the end; the times are near ``guesses``."""
    at, t, rows = mpmath.matrix(x), mpmath.mpf(0), list[list[Any]]()
    for k, guess in enumerate(guesses):
        mode = modes[k % len(modes)]
        along = mode.solution(at)
        s = mode.crossing(along, guess - t)
        t, at = t + s, mpmath.matrix(mode.reset) * along(s)
        rows.append([t, *at])
    return [*rows, [until, *modes[len(guesses) % len(modes)].solution(at)(until - t)]]


def switch(given: Mapping[str, Any]) -> tuple[list[Affine], list[Any]]:
    fast, slow = given["fast"], given["slow"]
    keep = [[1, 0], [0, 1]]
    a = [[-fast, fast], [0, -slow]]
    up, down = (mpmath.mpf(55) / 10, mpmath.mpf(4) / 10), (mpmath.mpf(273) / 100, -mpmath.mpf(3) / 10)
    modes = [
        Affine(a, [fast * shift, slow * goal], [way, 0], way * level, keep)
        for (goal, shift), way, level in ((up, 1, given["high"]), (down, -1, given["low"]))
    ]
    return modes, [given["initial.y1"], given["initial.y2"]]


def followers(given: Mapping[str, Any]) -> tuple[list[Affine], list[Any]]:
    k, a, half, tenth = given["k"], given["a"], mpmath.mpf(1) / 2, mpmath.mpf(1) / 10
    rising = [[-a, 0, 0], [k, -k, k], [5 * k, 0, -10 * k]]
    falling = [[-a, 0, 0], [k / 2, -k / 2, 0], [0, 20 * k, -20 * k]]
    up = [[97 * tenth**2, 0, 0], [0, 1, -2 * tenth], [0, 0, 1]]
    down = [[1, 0, 0], [0, 1, 0], [0, 0, half]]
    modes = [
        Affine(rising, [3, 0, 0], [-tenth, 1, 0], given["top"], up),
        Affine(falling, [-1, 0, 0], [0, 0, -1], -half / 2, down),
    ]
    return modes, [given["initial.x"], tenth, 2 * tenth**2]


def exact_slopes(exact: Any, given: Mapping[str, Any], by: str, until: Any, guesses: list[float]) -> list[list[Any]]:
    """Differences of what `executions` gives."""
    moved = [{**given, by: given[by] * (1 + way * STEP)} for way in (1, -1)]
    ahead, behind = (executions(*exact(each), until, guesses) for each in moved)
    return [
        [(p - q) / (2 * STEP * given[by]) for p, q in zip(a, b, strict=True)]
        for a, b in zip(ahead, behind, strict=True)
    ]


CASES: dict[str, tuple[Any, Any, dict[str, str], str, str]] = {
    "switch": (
        SWITCH,
        switch,
        {"fast": "2.7e6", "slow": "3.5651205", "high": "5.8", "low": "2.5", "initial.y1": "4.2", "initial.y2": "0.3"},
        "4.9",
        "1e-9",
    ),
    "followers": (FOLLOWERS, followers, {"k": "3e5", "a": "1.5", "top": "0.9", "initial.x": "0.1"}, "0.6", "1e-9"),
}


@needs_compiler
@pytest.mark.parametrize("name", CASES)
def test_stiff(name: str) -> None:
    """Times, states behind transitions, fast ones too, and the end agree to ten digits of the largest of each kind.

    The end lies on the slow motion.
    """
    model, exact, texts, until, tolerance = CASES[name]
    found = model.sensitivity(list(texts), until=until, tolerance=tolerance)
    assert found.exists
    guesses = [made.time for made in found.execution.transitions]
    assert len(guesses) > 1
    with mpmath.workdps(60):
        given = {by: mpmath.mpf(text) for by, text in texts.items()}
        for by in texts:
            slopes = exact_slopes(exact, given, by, mpmath.mpf(until), guesses)
            mine = [
                {"time": made.time[by], **{x: row[by] for x, row in made.after.items()}} for made in found.transitions
            ]
            mine.append({x: row[by] for x, row in found.final.state.items()})
            for i, kind in enumerate(("time", *found.final.state)):
                largest = max(abs(row[i]) for row in slopes)
                off = [abs(row[i] - own[kind]) for row, own in zip(slopes, mine, strict=True) if kind in own]
                assert max(off) <= 1e-10 * largest, (by, kind, off, largest)


@needs_compiler
def test_an_end_in_a_fast_decay() -> None:
    """A switch 3.5e-7 before the end: y1 moves by its whole jump in as much time as rounds off the time of the switch.

    Its derivative is that of a time which is off by as much as the run's last switch. Others keep ten digits.
    """
    _, exact, texts, _, _ = CASES["switch"]
    found = SWITCH.sensitivity(list(texts))
    guesses = [made.time for made in found.execution.transitions]
    with mpmath.workdps(60):
        given = {by: mpmath.mpf(text) for by, text in texts.items()}
        until = mpmath.mpf(5)
        late = guesses[-1] - executions(*exact(given), until, guesses)[-2][0]
        assert abs(late) < 1e-10
        for by in texts:
            slopes, since = (exact_slopes(exact, given, by, end, guesses) for end in (until, until - late))
            mine = {x: row[by] for x, row in found.final.state.items()}
            assert abs(mine["y2"] - slopes[-1][2]) <= 1e-10 * max(abs(row[2]) for row in slopes)
            assert abs(mine["y1"] - since[-1][1]) <= 1e-7 * max(abs(row[1]) for row in slopes), by


@pytest.mark.campaign  # a minute or more in Python's loop
def test_more_digits_give_an_end_in_a_fast_decay() -> None:
    """All derivatives to ten digits of the largest of their kind, which no run in doubles has of y1."""
    _, exact, texts, _, _ = CASES["switch"]
    texts = {by: text for by, text in texts.items() if by != "initial.y1"}  # which is forgotten in a microsecond
    found = SWITCH.sensitivity(list(texts), precision=25, tolerance="1e-14", method="radau")
    guesses = [float(made.time) for made in found.execution.transitions]
    with mpmath.workdps(60):
        given = {by: mpmath.mpf(text) for by, text in CASES["switch"][2].items()}
        for by in texts:
            slopes = exact_slopes(exact, given, by, mpmath.mpf(5), guesses)
            for i, name in enumerate(("y1", "y2"), 1):
                off = abs(found.final.state[name][by] - slopes[-1][i])
                assert off <= 1e-10 * max(abs(row[i]) for row in slopes), (by, name)


@pytest.mark.parametrize("by", ["slow", "high", "low"])
def test_the_last_digits_of_numbers_decide_an_end_in_a_fast_decay(by: str) -> None:
    """The exact derivatives of y1, by numbers that are one unit in the last place away: off by more than 1e-9.

    They move by more than twenty times what ten digits allow, as no run in doubles can know: the numbers of the file
    are rounded to doubles before anything else is done.
    """
    _, exact, texts, _, _ = CASES["switch"]
    guesses = [made.time for made in SWITCH.simulate().transitions]
    with mpmath.workdps(60):
        given = {name: mpmath.mpf(text) for name, text in texts.items()}
        rounded = {name: mpmath.mpf(float(text)) for name, text in texts.items()}
        apart = given | {"high": given["high"] + mpmath.mpf(math.ulp(5.8))}
        own, near, stored = (exact_slopes(exact, each, by, mpmath.mpf(5), guesses) for each in (given, apart, rounded))
        largest = max(abs(row[1]) for row in own)
        assert abs(near[-1][1] - own[-1][1]) > 1e-8 * largest
        assert abs(stored[-1][1] - own[-1][1]) > 2e-9 * largest


@needs_compiler
@pytest.mark.parametrize(("names", "most"), [("fast", 1.3), ("slow", 1.3), ("high", 1.3), ("fast,slow", 1.4)])
def test_steps_of_derivatives_that_decay(names: str, most: float) -> None:
    """A derivative of the fast state jumps by all of its size: steps are as long as its curve allows."""
    plain = SWITCH.simulate(method="radau", tolerance=1e-9)
    found = SWITCH.sensitivity(names, tolerance=1e-9).execution
    assert len(found.times) <= most * len(plain.times)


@needs_compiler
@pytest.mark.parametrize(("model", "wrt", "until"), [(FOLLOWERS, "k,a,initial.y", 0.25), (COUNTER, "a,initial.y", 1.2)])
def test_engines_agree_on_measured_slopes(model: hsdsl.Model, wrt: str, until: float) -> None:
    """To the last bit, also where no flow depends on a state."""
    call = {"until": until, "tolerance": 1e-6, "method": "radau"}
    python, compiled = (model.sensitivity(wrt, engine=engine, **call).execution for engine in ("python", "c"))
    assert [made.edge for made in compiled.transitions] == ["up"]
    assert same(python.values, compiled.values)
