# pyright: basic
"""Curated models of BioModels with events: the largest difference of each from libRoadRunner, of all its quantities.

Files are those of https://www.ebi.ac.uk/biomodels. The other simulator runs in an environment of its own:

    python -m venv rr && rr/bin/pip install libroadrunner==2.10.0
    python benchmarks/biomodels.py rr/bin/python 1000 BIOMD0000000111.xml BIOMD0000000152.xml ...
"""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np

import hsdsl
from hsdsl.interface.imports.sbml import DEEPEST, imported
from hsdsl.language.source.xml import read_xml

TOLERANCE = 1e-11
SAMPLES = 51
THEIRS = """
import json, sys, roadrunner
model = roadrunner.RoadRunner(sys.argv[1])
model.integrator.relative_tolerance, model.integrator.absolute_tolerance = 1e-10, 1e-14
model.integrator.maximum_num_steps = 200000
species = model.model.getFloatingSpeciesIds()
names = [*species, *model.model.getGlobalParameterIds()]
model.timeCourseSelections = ["time", *names]
values = model.simulate(times=json.loads(sys.argv[2]))
columns = dict(zip(names, [list(map(float, column)) for column in values[:, 1:].T]))
print(json.dumps({"species": list(species), "columns": columns}))
"""


def compared(python: str, end: float, path: Path) -> str:
    """The largest difference, relative to the size of each quantity; at a jump from the nearer side."""
    times = [end * k / (SAMPLES - 1) for k in range(SAMPLES)]
    command = [python, "-c", THEIRS, str(path), json.dumps(times)]
    theirs = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1])
    outputs = {name: "amount" if name in theirs["species"] else "value" for name in theirs["columns"]}
    text = imported(read_xml(str(path), path.read_bytes(), DEEPEST), repr(end * (1 + 1e-6)), outputs)
    run = hsdsl.loads(text).simulate(tolerance=TOLERANCE)
    if run.stop.reason != "until":
        return f"stopped: {run.stop.message}"
    sides = run.sample(times), run.sample(times, side="left")
    worst = (0.0, "", 0.0)
    for name, column in theirs["columns"].items():
        right = np.array(column)
        off = np.min([np.abs(np.asarray(side[f"out_{name}"], float) - right) for side in sides], axis=0)
        k = int(np.argmax(off))
        worst = max(worst, (float(off[k]) / max(float(np.abs(right).max()), 5e-324), name, times[k]))
    made = sum(" re-arms" not in each.edge for each in run.transitions)
    return f"{worst[0]:.1e} ({worst[1]} at {worst[2]:g}), {made} transitions"


def main() -> None:
    """Compare each file."""
    warnings.simplefilter("ignore")
    sys.setrecursionlimit(10000)
    python, end, *paths = sys.argv[1:]
    for path in map(Path, paths):
        print(path.stem, compared(python, float(end), path), flush=True)


if __name__ == "__main__":
    main()
