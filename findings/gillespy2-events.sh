#!/usr/bin/env bash
# How many events TauHybridSolver of GillesPy2 1.8.3 makes, and where, for continuous species, against closed forms.
#
# - The output times decide how many events happen. A saw tooth (x' = 1, minus 1.03 at x >= 1.03) should fall nine times
#   until 9.5: it falls once with 11 output times, eight times with 20, nine times with 101. The integrator's max_step
#   changes nothing.
# - An event happens late, at the end of a step. A ball from a height of 10 should be at 5.4936 at t = 3: it is at 1.16
#   with 4 output times, at 5.55 with 31, at 5.40 with 301.
#
# The length of the steps follows the output times: ask for many more than you need. Exits with 0 while this is so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check gillespy2==1.8.3 2> /dev/null
"$folder/venv/bin/python" -W ignore - << 'PYTHON'
import sys

import numpy as np
from gillespy2 import Event, EventAssignment, EventTrigger, Model, RateRule, Species, TauHybridSolver, TimeSpan


def last(starts, rates, trigger, assigned, until, points, **options):
    """The species at the end of a run with this number of output times."""
    model = Model(name="model")
    for name, value in starts.items():
        model.add_species(Species(name=name, initial_value=value, mode="continuous", allow_negative_populations=True))
    for name, rate in rates.items():
        model.add_rate_rule(RateRule(name=f"rate_{name}", variable=name, formula=rate))
    assignments = [EventAssignment(variable=name, expression=value) for name, value in assigned.items()]
    model.add_event(Event(name="event", trigger=EventTrigger(expression=trigger), assignments=assignments))
    model.timespan(TimeSpan(np.linspace(0, until, points)))
    run = model.run(solver=TauHybridSolver, **options)
    return {name: float(run[name][-1]) for name in starts}


def falls(points, **options):
    return last({"x": 0, "n": 0}, {"x": "1"}, "x >= 1.03", {"x": "x - 1.03", "n": "n + 1"}, 9.5, points, **options)["n"]


def height(points):
    return last({"h": 10, "v": 0}, {"h": "v", "v": "-9.81"}, "h < 0", {"v": "-0.8*v"}, 3, points)["h"]


counts = {points: falls(points) for points in (5, 11, 20, 101)}
print("falls of the saw tooth, exactly 9:", *(f"{count:.0f} with {n} output times" for n, count in counts.items()))
step = falls(11, integrator_options={"max_step": 1e-2, "rtol": 1e-8, "atol": 1e-8})
heights = {points: height(points) for points in (4, 31, 301)}
print("height of the ball at t = 3, exactly 5.4936:", *(f"{value:.4f} with {n}" for n, value in heights.items()))
seen = {
    "one fall with 5 and with 11 output times, eight with 20, nine with 101": tuple(counts.values()) == (1, 1, 8, 9),
    "a max_step of 0.01 and tolerances of 1e-8 leave it at one": step == 1,
    "the height is wrong by more than 4, 0.05 and 0.09":
        all(abs(heights[n] - 5.4936) > most for n, most in ((4, 4), (31, 0.05), (301, 0.09))),
}
for sentence, holds in seen.items():
    print("yes" if holds else "NO ", sentence)
sys.exit(not all(seen.values()))
PYTHON
