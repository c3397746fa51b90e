#!/usr/bin/env bash
# What solve_ivp of SciPy 1.17.1 does with events at one instant and at the end of a step, for x' = 1 from 0.
#
# - Beside a terminal event, another event at the same instant is not in t_events if it comes later in the list.
# - If a step ends where an event function is 0, LSODA reports the event twice.
#
# Exits with 0 while this is so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check --only-binary :all: scipy==1.17.1 2> /dev/null
"$folder/venv/bin/python" - << 'PYTHON'
import sys

from scipy.integrate import solve_ivp

METHODS = ("RK45", "DOP853", "LSODA", "Radau")


def run(method, *levels, until=3.0, **options):
    """The times of the events x = level; those of a positive ``terminal`` end the run."""
    events = []
    for level, terminal in levels:
        event = lambda t, x, level=level: x[0] - level
        event.terminal, event.direction = terminal, 1
        events.append(event)
    made = solve_ivp(lambda t, x: [1.0], (0.0, until), [0.0], method=method, events=events, rtol=1e-9, **options)
    return [[round(float(t), 9) for t in times] for times in made.t_events]


steps = {"max_step": 0.25, "first_step": 0.25}
lsoda = run("LSODA", (1.0, False), **steps)
print("steps of 0.25 by LSODA, event at 1:", *lsoda)
print("two events at 1, the first terminal:", *(run(method, (1.0, True), (1.0, False)) for method in METHODS))
seen = {
    "of two events at 1 the later of the list is missing beside a terminal one":
        all(run(m, (1.0, True), (1.0, False)) == [[1.0], []] for m in METHODS),
    "LSODA reports an event at the end of a step twice": lsoda == [[1.0, 1.0]],
}
for sentence, holds in seen.items():
    print("yes" if holds else "NO ", sentence)
sys.exit(not all(seen.values()))
PYTHON
