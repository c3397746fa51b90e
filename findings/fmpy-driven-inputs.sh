#!/usr/bin/env bash
# FMPy 0.3.32, model exchange: CVode integrates with the input of an earlier time, and Euler compares event indicators
# with those from before the last event. Both are shown on FMPy's own solver classes, with a model written in Python.
# Exits with 0 while this is so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check fmpy==0.3.32 2> /dev/null
"$folder/venv/bin/python" - << 'PYTHON'
import math
import sys

import fmpy
from fmpy.simulation import ForwardEuler
from fmpy.sundials import CVodeSolver


class Model:
    """x' = u, where the tool sets u = cos(t); without a guard, or with one that is never met."""

    time, x, u, slope, indicator = 0.0, 0.0, 1.0, None, 1.0

    def get_x(self, p, n): p[0] = self.x
    def set_x(self, p, n): self.x = p[0]
    def get_dx(self, p, n): p[0] = self.u if self.slope is None else self.slope
    def get_nominals(self, p, n): p[0] = 1.0
    def set_time(self, time): self.time = time
    def apply(self, time, **further): self.u = math.cos(time)

    def get_z(self, p, n):
        for k in range(n):
            p[k] = self.indicator if self.slope is None else 1.0 - self.x


def error(guards, tolerance):
    model = Model()
    callbacks = {name: getattr(model, name) for name in ("get_x", "set_x", "get_dx", "get_z")}
    solver = CVodeSolver(
        nx=1, nz=guards, **callbacks, get_nominals=model.get_nominals, set_time=model.set_time, input=model,
        startTime=0.0, maxStep=0.2, relativeTolerance=tolerance,
    )
    time, worst = 0.0, 0.0
    for k in range(1, 101):
        _, _, time = solver.step(time, 0.1 * k)
        model.apply(time)
        worst = max(worst, abs(model.x - math.sin(time)))
    return worst


def roots_of_euler():
    """x' = 1 in steps of 0.5 with the guard x >= 1, whose event sets x to 0.9: a further step passes it again."""
    model = Model()
    model.slope = 1.0
    solver = ForwardEuler(1, 1, model.get_x, model.set_x, model.get_dx, model.get_z, model)
    found = []
    for k in range(5):
        event, _, _ = solver.step(0.5 * k, 0.5 * k + 0.5)
        found.append(bool(event))
        if event:
            model.x = 0.9
            solver.reset(0.5 * k + 0.5)
    return found


print("FMPy", fmpy.__version__)
without = [error(0, tolerance) for tolerance in (1e-4, 1e-8)]
guarded = [error(1, tolerance) for tolerance in (1e-4, 1e-6, 1e-8)]
euler = roots_of_euler()
print("x' = cos(t) by CVode, largest error until 10")
print("  without event indicators, at 1e-4 and 1e-8:", *(f"{value:.2g}" for value in without))
print("  with one, at 1e-4, 1e-6 and 1e-8:          ", *(f"{value:.2g}" for value in guarded))
print("events that Euler finds where each of five steps but the first ends beyond a guard:", euler)
as_described = min(without) > 0.1 and guarded[0] > 0.05 and guarded[1] > 1e-3 and euler == [False, True, False, False, False]
sys.exit(0 if as_described else 1)
PYTHON
