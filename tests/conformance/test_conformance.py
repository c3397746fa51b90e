"""Tiny models with exact answers, one point of the language's meaning each, on every method, scheme and engine.

A case is two files in ``cases/``: ``NAME.yaml``, a legal model, and ``NAME.expect.yaml``, what its runs must give.

========================= ==========================================================================================
with                      further arguments of ``simulate`` (values are expressions)
settings                  names from ``settings.yaml``; all of them when left out
scheme                    schemes it holds for; all when left out
within                    error allowed beyond round-off in every number (derived in the case's comment); 0
transitions               all of them, in order: edge; ``time`` (corrected) or ``at`` (as recorded); ``speed`` of the
                          crossing (1); ``delay: [least, most]`` instead of what the speed implies; ``resumed: never``;
                          ``entry``; ``alternatives`` (none); ``before`` and ``after`` by name, unchecked when left out
count                     instead of transitions: the least and largest number of them
stop                      reason, time, within, message (words it must contain)
final                     mode, state (all of it), outputs, within
grid                      every row's time is a multiple of the step
rows                      times that must be rows
warnings                  all of them, in order: code, ``edge``, ``at`` and how ``often`` (1); unchecked when left out
========================= ==========================================================================================

Expectations are arithmetic over ``eps`` (the relaxation), ``h`` (the step, 0 for an adaptive method), ``u`` (unit
round-off), the delays ``d0, d1, ...`` (``resumed - time`` of each transition) and ``delay`` (their sum). A *corrected*
time is the recorded one less all earlier delays: where the flow is the same at all times, the relaxed execution is the
execution delayed, so corrected times and the states at transitions are those of the hybrid system itself, whatever the
relaxation. A strip is ``eps - tau`` long after a step that ended at depth tau in (0, eps], tau/s after the crossing at
speed s = L_f r/|grad r|; so the delay is eps + tau (1/s - 1), between eps and eps/s.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import mpmath as mp
import pytest
import yaml
from engines import COMPILER
from exact.arithmetic import evaluate

import hsdsl

HERE = Path(__file__).parent
CASES = {  # those of parts and events apart: exports take the others as they are
    path.name.removesuffix(".expect.yaml"): path
    for folder in ("cases", "parts", "events")
    for path in sorted((HERE / folder).glob("*.expect.yaml"))
}
MEANING = [f"M{k}" for k in range(1, 14)]
SCHEMES = ("relaxed", "located")
DIGITS = ("rk4-30-digits", "adaptive-30-digits")
LIMIT = 30  # seconds for one run; most take a thousandth of it


def read(path: Path) -> Any:
    """YAML with every scalar as text."""
    return yaml.load(path.read_text(), Loader=getattr(yaml, "CBaseLoader", yaml.BaseLoader))


SETTINGS: dict[str, dict[str, str]] = read(HERE / "settings.yaml")
NUMBERS = ("step", "tolerance", "relaxation")


def given(setting: str) -> dict[str, Any]:
    """A setting as arguments of a run; its numbers are exact, and need no parsing each time."""
    named = {name: value for name, value in SETTINGS[setting].items() if name != "only"}
    return {name: Fraction(value) if name in NUMBERS else value for name, value in named.items()}


@dataclass(frozen=True)
class Step:
    """One expected transition."""

    edge: str
    time: str | None = None
    at: str | None = None
    speed: str = "1"
    delay: list[str] | None = None
    resumed: str | None = None
    entry: str = "false"
    alternatives: list[str] = field(default_factory=list)
    before: dict[str, str] = field(default_factory=dict)
    after: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if (self.time is None) == (self.at is None):
            raise ValueError(f"{self.edge}: either time or at")


@dataclass(frozen=True)
class Stop:
    """The expected end; ``time`` may stay open."""

    reason: str
    time: str | None = None
    within: str = "0"
    message: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Final:
    """The expected last value."""

    mode: str
    state: dict[str, str]
    outputs: dict[str, str] = field(default_factory=dict)
    within: str = "0"


@dataclass(frozen=True)
class Warned:
    """One expected warning."""

    code: str
    edge: str | None = None
    at: str | None = None
    often: str = "1"


@dataclass(frozen=True)
class Run:
    """One entry of a case's ``runs``."""

    stop: Stop
    arguments: dict[str, Any]
    settings: list[str]
    scheme: list[str]
    within: str
    transitions: list[Step] | None
    count: list[str] | None
    final: Final | None
    grid: bool
    rows: list[str]
    warnings: list[Warned] | None

    @classmethod
    def of(cls, raw: dict[str, Any]) -> Run:
        """From a file's mapping; raises on keys that mean nothing."""
        raw = dict(raw)
        transitions, final = raw.pop("transitions", None), raw.pop("final", None)
        warned = raw.pop("warnings", None)
        run = cls(
            stop=Stop(**raw.pop("stop")),
            arguments=raw.pop("with", {}),
            settings=raw.pop("settings", list(SETTINGS)),
            scheme=raw.pop("scheme", list(SCHEMES)),
            within=raw.pop("within", "0"),
            transitions=None if transitions is None else [Step(**step) for step in transitions],
            count=raw.pop("count", None),
            final=final and Final(**final),
            grid=raw.pop("grid", "false") == "true",
            rows=raw.pop("rows", []),
            warnings=None if warned is None else [Warned(**one) for one in warned],
        )
        if raw or (run.transitions is None) == (run.count is None):
            raise ValueError(f"unknown keys {list(raw)}, or not exactly one of transitions and count")
        return run


def engines(setting: str) -> list[tuple[str, Any]]:
    """The engines for a setting, and marks: that of floats in Python gives the bits of C, as `test_agreement` shows."""
    if "precision" in SETTINGS[setting] or not COMPILER:
        return [("python", ())]
    return [("c", ()), ("python", pytest.mark.campaign)]


def settings_of(run: Run, turn: int) -> list[tuple[str, Any]]:
    """The settings of a run, and marks: cases take turns in the explicit methods in thirty digits, campaigns both."""
    left = DIGITS[turn % 2] if {*DIGITS} <= {*run.settings} else None
    return [(setting, pytest.mark.campaign if setting == left else ()) for setting in run.settings]


def parameters() -> list[Any]:
    """Every run of every case in every setting that it names, by every engine that has it."""
    return [
        pytest.param(
            name, run, setting, scheme, engine,
            id=f"{name}-{number}-{setting}-{scheme}-{engine}", marks=of_setting or of_engine,
        )
        for turn, (name, path) in enumerate(CASES.items())
        for number, run in enumerate(map(Run.of, read(path)["runs"]))
        for scheme in run.scheme
        for setting, of_setting in settings_of(run, turn + SCHEMES.index(scheme))
        if SETTINGS[setting].get("only", scheme) == scheme
        for engine, of_engine in engines(setting)
    ]  # fmt: skip


@lru_cache(maxsize=4)  # a model that ran holds memory for each of its settings
def model(name: str) -> Any:
    """A case's model, loaded once."""
    return hsdsl.load(CASES[name].with_name(f"{name}.yaml"))


class Comparison:
    """Compares numbers of one execution with expectations, up to round-off and what the run allows."""

    def __init__(self, run: Run, setting: dict[str, str], execution: Any) -> None:
        digits = int(setting.get("precision", 0))
        self.roundoff = mp.mpf(10) ** (3 - digits) if digits else mp.mpf("2e-13")
        self.names = {
            "eps": evaluate(setting["relaxation"]),
            "h": evaluate(setting.get("step", 0)),
            "u": mp.mpf(10) ** (1 - digits) if digits else mp.mpf(2) ** -53,
            "delay": mp.mpf(0),
        }
        self.raw, self.execution = run, execution
        self.within = self.value(run.within)
        self.delays: list[mp.mpf] = []
        for k, transition in enumerate(execution.transitions):
            delay = mp.mpf(0) if transition.resumed is None else mp.mpf(transition.resumed) - mp.mpf(transition.time)
            self.delays.append(delay)
            self.names[f"d{k}"] = delay
            self.names["delay"] += delay

    def value(self, text: str) -> mp.mpf:
        """The number that a text stands for in this run."""
        return evaluate(text, self.names)

    def same(self, actual: Any, expected: str, what: str, within: str = "0") -> None:
        """Assert that a number is the expected one."""
        right, got = self.value(expected), mp.mpf(actual)
        allowed = self.roundoff * max(1, abs(right)) + self.within + self.value(within)
        if mp.isnan(right):
            assert mp.isnan(got), f"{what}: {got} instead of nan"
        else:
            assert abs(got - right) <= allowed, (
                f"{what}: {mp.nstr(got, 20)} instead of {expected} = {mp.nstr(right, 20)} "
                f"(off by {mp.nstr(abs(got - right), 3)}, allowed {mp.nstr(allowed, 3)})"
            )

    def transition(self, k: int, step: Step, scheme: str) -> None:
        """Assert that transition k is the expected one."""
        actual, what = self.execution.transitions[k], f"transition {k} ({step.edge})"
        assert actual.edge == step.edge
        assert actual.entry == (step.entry == "true"), f"{what}: entry"
        assert sorted(actual.alternatives) == sorted(step.alternatives), f"{what}: alternatives"
        if step.at is not None:
            self.same(actual.time, step.at, f"{what}: recorded time")
        else:
            self.same(mp.mpf(actual.time) - sum(self.delays[:k]), str(step.time), f"{what}: corrected time")
        for side in ("before", "after"):
            for name, right in getattr(step, side).items():
                self.same(getattr(actual, side)[name], right, f"{what}: {name} {side}")
        if step.resumed == "never":
            assert actual.resumed is None and actual.after is None, f"{what}: resumed"
        else:
            self.delay(k, step, scheme, what)

    def delay(self, k: int, step: Step, scheme: str, what: str) -> None:
        """Assert that the run went on after transition k when it should."""
        assert self.execution.transitions[k].resumed is not None, f"{what}: never resumed"
        eps, speed = self.names["eps"], self.value(step.speed)
        bounds = [self.value(b) for b in step.delay] if step.delay else sorted([eps, eps / speed])
        if scheme != "relaxed" or step.entry == "true":
            bounds = [mp.mpf(0), mp.mpf(0)]
        slack = self.roundoff * max(1, abs(mp.mpf(self.execution.stop.time))) / min(1, speed) + self.within
        assert bounds[0] - slack <= self.delays[k] <= bounds[1] + slack, (
            f"{what}: delay {mp.nstr(self.delays[k], 12)} outside {[mp.nstr(b, 12) for b in bounds]}"
        )

    def end(self, run: Run) -> None:
        """Assert that the run ended as expected."""
        stop, final = self.execution.stop, self.execution.final
        assert stop.reason == run.stop.reason, stop.message
        assert final.time == stop.time
        if run.stop.time is not None:
            self.same(stop.time, run.stop.time, "stop.time", run.stop.within)
        for word in run.stop.message:
            assert word in stop.message
        if run.final is not None:
            assert final.mode == run.final.mode
            assert set(final.state) == set(run.final.state)
            for name, right in run.final.state.items():
                self.same(final.state[name], right, f"final {name}", run.final.within)
            for name, right in run.final.outputs.items():
                self.same(final.outputs[name], right, f"final output {name}", run.final.within)

    def warnings(self, expected: list[Warned]) -> None:
        """Assert what the run tells first."""
        told = self.execution.warnings
        assert [(one.code, one.edge) for one in told] == [(one.code, one.edge) for one in expected], told
        for actual, one in zip(told, expected, strict=True):
            if one.at is not None:
                self.same(actual.time, one.at, f"time of {one.code}", "2e-13")  # it is found in floats
            assert (f" {one.often} times, first " in actual.message) == (one.often != "1"), actual.message

    def rows(self, run: Run, scheme: str) -> None:
        """Assert what the run says of the times of its rows."""
        times = [mp.mpf(t) for t in self.execution.times]
        for right in run.rows:
            assert min(abs(t - self.value(right)) for t in times) <= self.roundoff, f"no row at {right}"
        if run.grid and scheme == "relaxed":
            steps = [t / self.names["h"] for t in times]
            assert all(abs(s - mp.nint(s)) <= self.roundoff * max(1, s) for s in steps), "a step was shortened"


def assert_legal(execution: Any) -> None:
    """Assert what holds of every execution: transitions follow each other, in time and from mode to mode."""
    ends = [execution.stop.time]
    for k, transition in enumerate(execution.transitions):
        assert transition.index == k
        ends.extend(t for t in (transition.time, transition.resumed) if t is not None)
        assert transition.resumed is None or transition.resumed >= transition.time
    for one, two in zip(execution.transitions, execution.transitions[1:], strict=False):
        assert one.target == two.source and one.resumed is not None and two.time >= one.resumed
    assert max(ends) == execution.stop.time == max(execution.times), "something is later than the end"


@pytest.fixture(autouse=True)
def no_run_is_endless() -> Iterator[None]:
    """Make a run that does not end a failure instead of a hang (where the platform has alarms)."""

    def give_up(*_: Any) -> None:
        raise TimeoutError(f"still running after {LIMIT} s")

    if not hasattr(signal, "SIGALRM"):
        yield
        return
    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(LIMIT)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize(("name", "run", "setting", "scheme", "engine"), parameters())
def test_conformance(name: str, run: Run, setting: str, scheme: str, engine: str) -> None:
    with mp.workdps(45):
        arguments = {**given(setting), **run.arguments, "engine": engine, "scheme": scheme}
        for whole in ("precision", "max_transitions"):
            if whole in arguments:
                arguments[whole] = int(arguments[whole])
        if engine == "c" and "precision" in arguments:  # of the case itself
            arguments["engine"] = "python"
        execution = model(name).simulate(**arguments)
        assert_legal(execution)
        comparison = Comparison(run, SETTINGS[setting], execution)
        edges = [(t.edge, str(t.time)) for t in execution.transitions[:20]]
        if run.count is not None:
            least, most = map(comparison.value, run.count)
            assert least <= len(execution.transitions) <= most
        for k, step in enumerate(run.transitions or []):
            assert k < len(edges), f"only {edges}; {execution.stop}"
            comparison.transition(k, step, scheme)
        assert run.transitions is None or len(edges) == len(run.transitions), edges
        comparison.end(run)
        comparison.rows(run, scheme)
        if run.warnings is not None:
            comparison.warnings(run.warnings)


def test_every_model_has_expectations() -> None:
    models = {p.stem for p in HERE.glob("*/*.yaml") if not p.name.endswith(".expect.yaml")}
    assert models == set(CASES)
    assert all(read(path)["runs"] for path in CASES.values())


@pytest.mark.parametrize("point", MEANING)
def test_every_point_of_the_meaning_has_a_case(point: str) -> None:
    assert any(point in read(path)["meaning"] for path in CASES.values())


@pytest.mark.parametrize("setting", SETTINGS)
def test_every_setting_runs(setting: str) -> None:
    assert any(setting in Run.of(raw).settings for path in CASES.values() for raw in read(path)["runs"])
