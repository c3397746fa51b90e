"""The gallery of models: what each shows, how it runs, its picture."""

from __future__ import annotations

import sys
from pathlib import Path
from textwrap import fill
from typing import NamedTuple

import hsdsl
from hsdsl.analysis.report.words import number
from hsdsl.engine.execution import Execution

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "images" / "models"

MODELS = """# Models

Twenty models to run, read and change. Each runs in some milliseconds; `--plot FILE.html` instead of a picture gives a
page to zoom in. [Where methods fail](gallery.md) has 31 more scenes, each with an exact solution.

"""


class Entry(NamedTuple):
    """A model of the gallery: its file without `.yaml`, and a sentence."""

    file: str
    about: str
    engine: str = "python"  # without a compiler, since that takes longer than most runs

    @property
    def name(self) -> str:
        """Its name, also that of its picture."""
        return Path(self.file).name

    def run(self) -> tuple[hsdsl.Model, Execution]:
        """Load and run it."""
        model = hsdsl.load(ROOT / f"{self.file}.yaml")
        return model, model.simulate(engine=self.engine)


GROUPS = {
    "Machines": (
        Entry("models/bouncing-ball", "The smallest model with a jump."),
        Entry("examples/models/shaken-table", "The guard moves. The ball flies, and rests on the table for a while."),
        Entry(
            "models/oscillator-with-stop-1", "A driven mass hits a stop 49 times; the paper's first example.", "auto"
        ),
        Entry(
            "models/constrained-pendulum",
            "A string is caught by a pin: its length changes, and the speed jumps.",
            "auto",
        ),
        Entry("models/gallery/rolling-ball", "After infinitely many bounces the ball goes on rolling."),
        Entry("models/gallery/cascade", "Newton's cradle: impacts one after the other, at one instant."),
        Entry("models/gallery/stick-slip", "Dry friction: the mass sticks to the belt, until the spring is stronger."),
        Entry("models/gallery/draining-tank", "A tank runs empty, and its law has no value below zero."),
    ),
    "Legs": (
        Entry("examples/models/spring-legged-runner", "A spring for a leg: where the foot lands is set by a reset."),
        Entry("models/pronking-runner", "A body on two legs that land and lift off at the same instant."),
        Entry(
            "examples/orbits/compass-walker",
            "Two stiff legs walk down a slope, with a mass matrix solved by hand.",
            "auto",
        ),
    ),
    "Control and power": (
        Entry("models/thermostat", "Two modes and two thresholds."),
        Entry("examples/models/cruise-control", "A PI controller that saturates, on a road from a CSV file."),
        Entry("examples/models/sump-pump", "Dwell timers: at least two minutes on, at least one off."),
        Entry("examples/models/buck-converter", "Pulse-width modulation, and a diode that blocks."),
        Entry("models/digital-control", "Two guards reached together, and both orders are right."),
    ),
    "Life and chemistry": (
        Entry("examples/models/drug-dosing", "Six doses, counted: a course of treatment and its end."),
        Entry("examples/models/cell-division", "A cell divides a fixed time after a critical size."),
        Entry("examples/models/spiking-neuron", "A neuron fires while a current flows in."),
        Entry("models/stiff-switch", "Two time scales, six powers of ten apart, and a switch between them.", "auto"),
    ),
}


def model_page() -> str:
    """Write the page; every model is run for it."""
    return MODELS + "".join(f"## {group}\n\n" + "".join(map(section, entries)) for group, entries in GROUPS.items())


def section(entry: Entry) -> str:
    """Write one model: what it is, its command, its picture and how the run ended."""
    model, run = entry.run()
    count = len(run.transitions)
    ended = f"{count} transition{'s' * (count != 1)} to t = {number(float(run.stop.time), 6)}"
    title = model.program.title or entry.name
    about = fill(f"{title}. {entry.about} {ended}; the verdict is `{run.verdict.theorem}`.", 120)
    return (
        f"### {entry.name}\n\n{about}\n\n"
        f"`hsdsl run {entry.file}.yaml --plot {entry.name}.html`\n\n"
        f"![{title}](images/models/{entry.name}.png)\n\n"
    )


def draw() -> None:
    """Draw every picture, in few colours: small files."""
    from PIL import Image

    PICTURES.mkdir(parents=True, exist_ok=True)
    for entry in (entry for entries in GROUPS.values() for entry in entries):
        model, run = entry.run()
        path = PICTURES / f"{entry.name}.png"
        model.plot(run, path)
        with Image.open(path) as picture:
            small = picture.convert("RGB").resize((900, round(900 * picture.height / picture.width)))
        small.quantize(48).save(path, optimize=True)


def main() -> int:
    """Draw the pictures again: `python docs/writing/models.py`."""
    draw()
    return 0


if __name__ == "__main__":
    sys.exit(main())
