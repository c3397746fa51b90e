"""The scenes of the gallery: models, words about them, and exact executions at sample times."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from hsdsl import load
from hsdsl.analysis.exact import reference
from hsdsl.analysis.store import load as load_execution
from hsdsl.engine.execution import Execution
from hsdsl.interface.chart import Scene
from hsdsl.interface.model import Model

MODELS = Path(__file__).parents[2] / "models"
GALLERY = MODELS / "gallery"
CLEARANCE = 1e-4  # of the run: a sample nearer than this to an exact jump need not have a value
ROUNDED = 1e-9  # of the run: a transition nearer than this to the end may be left out
WORDS = ("What", "Exact", "Hard")
UNDECIDED = ("two-ways",)  # either of two executions is as good as the other: the answer is to say so
OLDER = {
    "oscillator-with-stop-1": (
        "a forced mass hits a stop 49 times, fast and slow, and once misses it by 0.04.",
        "waves between impacts; impacts as roots to forty digits.",
        "short visits to the stop lie within one step, and one missed impact changes all that follow.",
    ),
    "oscillator-with-stop-2": (
        "a forced mass rests at a stop, leaves it, bounces to rest, leaves it again, and bounces to rest.",
        "stuck to 2.4981, Zeno points at 5.0645 and 11.3477, stuck from 5.0645 to 8.7813.",
        "at rest on its guard a mass has no flow to follow, and nothing fires when the force lets it go.",
    ),
    "stiff-switch": (
        "a state that relaxes within 4e-7 follows a slow one between two levels; five switches.",
        "two exponentials a mode; the last switch is 3.5e-7 before the end.",
        "explicit methods take millions of steps or blow up, and loose ones miss the last switch.",
    ),
}
"""Models of ``models/`` that are scenes too, with their words."""


@dataclass(frozen=True)
class Entry:
    """A scene of the gallery; its words are the comments under the title of its file."""

    name: str
    path: Path

    @cached_property
    def words(self) -> tuple[str, str, str]:
        """What happens, the exact answer, and why methods fail there."""
        if self.name in OLDER:
            return OLDER[self.name]
        lines = self.path.read_text(encoding="utf-8").splitlines()
        what, exact, hard = (
            next(line.removeprefix(f"# {word}: ") for line in lines if line.startswith(f"# {word}: ")) for word in WORDS
        )
        return what, exact, hard

    @cached_property
    def model(self) -> Model:
        """The model."""
        return load(self.path)

    @cached_property
    def exact(self) -> Execution:
        """The exact execution."""
        stored = GALLERY / "references" / f"{self.name}.npz"
        return load_execution(stored) if stored.is_file() else reference(self.model)

    @cached_property
    def until(self) -> float:
        """The end of a run of the file."""
        return float(self.model.pipeline.prepare({}).settings.until)

    @cached_property
    def scene(self) -> Scene:
        """The exact execution at sample times, and how many transitions are right."""
        jumps = [float(t.time) for t in self.exact.transitions]
        found = Scene.of(self.model, exact=self.exact, clearance=CLEARANCE * self.until, until=self.until)
        surely = sum(t < (1 - ROUNDED) * self.until for t in jumps)
        return found if self.without_end else replace(found, countable=(surely, len(jumps)))

    @property
    def without_end(self) -> bool:
        """Whether any number of transitions is right: infinitely many, or sliding."""
        known = {mode.name for mode in self.model.program.modes}
        slides = any(arc.mode not in known for arc in self.exact.arcs)
        return slides or any("infinitely many" in reason for reason in self.exact.verdict.reasons)


def entries() -> dict[str, Entry]:
    """All scenes by name."""
    found = [Entry(path.stem, path) for path in sorted(GALLERY.glob("*.yaml"))]
    found += [Entry(name, MODELS / f"{name}.yaml") for name in OLDER]
    return {entry.name: entry for entry in sorted(found, key=lambda entry: entry.name)}
