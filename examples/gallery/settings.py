"""The runs of a scene: our schemes, methods and engines, and peers, each with its settings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from gallery.scenes import UNDECIDED, Entry
from hsdsl.base.defaults import SCHEMES
from hsdsl.base.errors import UsageError
from hsdsl.engine.integrators import METHODS
from hsdsl.engine.preparation.options import OWN_FORMULA
from hsdsl.interface.chart import PEERS, Refused
from hsdsl.interface.chart.outcome import WITHIN, Outcome, outcome
from hsdsl.interface.chart.peers import prepare
from hsdsl.interface.chart.plan import relaxation
from hsdsl.interface.chart.scene import Tool

TOLERANCES = (1e-6, 1e-9)
STEPS = (1e-3, 1e-4)  # of the run
MOST = 100_000  # transitions
ENGINES = ("c", "python")
SAMPLED = ("", "midpoint", "dopri5", "taylor")  # methods of the Python engine, which agrees with C to the last bit


class Setting(NamedTuple):
    """A tool with its settings; ``step`` is a share of the run, and peers have no step."""

    name: str
    scheme: str = ""
    method: str = ""
    tolerance: float | None = None
    step: float | None = None

    @property
    def label(self) -> str:
        """The tool, its scheme and its method."""
        return Tool(self.name, self.scheme, self.method).label

    @property
    def size(self) -> str:
        """Its tolerance or step."""
        return f"tolerance {self.tolerance:.0e}" if self.tolerance else f"step {self.step:.0e} of the run"


def own_settings(engines: tuple[str, ...] = ENGINES) -> Iterator[Setting]:
    """Every scheme, method and engine of ours."""
    for scheme in SCHEMES:
        for method in ("",) if scheme in OWN_FORMULA else METHODS:
            for engine in engines:
                base = Setting(f"hsdsl {engine}", scheme, method)
                if (engine == "python" and method not in SAMPLED) or (engine == "c" and not method):
                    continue  # no compiled loop has the schemes with their own formula
                sizes = slice(1) if engine == "python" and method else slice(None)
                if method and METHODS[method].adaptive:
                    yield from (base._replace(tolerance=value) for value in TOLERANCES[sizes])
                else:
                    yield from (base._replace(step=value) for value in STEPS[sizes])


def peer_settings() -> Iterator[Setting]:
    """Every peer, installed or not."""
    for name in PEERS:
        yield from (Setting(name, tolerance=value) for value in TOLERANCES)


def run(entry: Entry, setting: Setting) -> Outcome:
    """Run a scene with a tool and judge what comes."""
    try:
        found = _own(entry, setting) if setting.name.startswith("hsdsl") else _peer(entry, setting)
    except (Refused, UsageError) as refusal:
        return Outcome("refuses", str(refusal))
    if entry.name in UNDECIDED and found.word == "right" and found.verdict not in ("left", "unknown"):
        return found._replace(word="wrong", why="gives one of two executions and does not say so")
    return found


def _own(entry: Entry, setting: Setting) -> Outcome:
    scene = entry.scene
    options: dict[str, Any] = {"scheme": setting.scheme, "method": setting.method or None}
    value = setting.tolerance or (setting.step or 0) * entry.until
    options |= {"tolerance" if setting.tolerance else "step": value}
    if setting.scheme == "relaxed":
        options["relaxation"] = relaxation(setting.method, setting.tolerance or setting.step or 0) * min(1, entry.until)
    engine = setting.name.removeprefix("hsdsl ")
    run = entry.model.simulate(**options, engine=engine, max_transitions=MOST)
    result = scene.result(run)
    if result.problem:
        result = replace(result, problem=f"{run.stop.reason}: {result.problem}")
    return outcome(scene, result, WITHIN, run.estimated().verdict)


def _peer(entry: Entry, setting: Setting) -> Outcome:
    assert setting.tolerance is not None
    return outcome(entry.scene, prepare(setting.name, entry.scene)(setting.tolerance), WITHIN)
