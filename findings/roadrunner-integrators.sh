#!/usr/bin/env bash
# Which integrators of libroadrunner 2.10.0 follow SBML events, and which reach the times that they print.
#
# - rk4 and rk45 ignore events without a message: a ball falls through the floor. euler makes an event at the end of its
#   step, which is the output interval. cvode, the default, locates it to 2e-6.
# - rk45 makes one step of its own length for each output interval and prints the value for the end of the interval:
#   x' = -x from 1 has 0.982 at t = 2 with 5 points, 0.914 with 21, instead of 0.135. Only a run without a number of
#   points is right, since it prints the times of the steps.
#
# Exits with 0 while this is so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check libroadrunner==2.10.0 2> /dev/null
"$folder/venv/bin/python" - << 'PYTHON'
import math
import sys

import roadrunner

roadrunner.Logger.disableLogging()
seen = []


def show(sentence, holds):
    print("yes" if holds else "NO ", sentence)
    seen.append(bool(holds))


def content(text):
    return f'<math xmlns="http://www.w3.org/1998/Math/MathML">{text}</math>'


def document(rates, starts, events=""):
    given = "".join(f'<parameter id="{name}" value="{value}" constant="false"/>' for name, value in starts.items())
    rules = "".join(f'<rateRule variable="{name}">{content(rate)}</rateRule>' for name, rate in rates.items())
    space = "http://www.sbml.org/sbml/level3/version2/core"
    return (
        f'<sbml xmlns="{space}" level="3" version="2"><model id="m"><listOfParameters>{given}</listOfParameters>'
        f"<listOfRules>{rules}</listOfRules>{events}</model></sbml>"
    )


def end(text, integrator, points, name):
    """The last time and value of a run to 2, with this number of points."""
    runner = roadrunner.RoadRunner(text)
    runner.setIntegrator(integrator)
    runner.timeCourseSelections = ["time", name]
    return tuple(map(float, (runner.simulate(0, 2, points) if points else runner.simulate(0, 2))[-1]))


time = '<csymbol encoding="text" definitionURL="http://www.sbml.org/sbml/symbols/time">t</csymbol>'
assigned = {"hit": time, "v": "<apply><times/><cn>-0.8</cn><ci>v</ci></apply>"}
event = (
    '<listOfEvents><event useValuesFromTriggerTime="true"><trigger initialValue="true" persistent="true">'
    + content("<apply><lt/><ci>h</ci><cn>0</cn></apply>")
    + "</trigger><listOfEventAssignments>"
    + "".join(f'<eventAssignment variable="{name}">{content(value)}</eventAssignment>' for name, value in assigned.items())
    + "</listOfEventAssignments></event></listOfEvents>"
)
ball = document({"h": "<ci>v</ci>", "v": "<cn>-9.81</cn>"}, {"h": 10, "v": 0, "hit": 0}, event)
decay = document({"x": "<apply><minus/><ci>x</ci></apply>"}, {"x": 1})
exact = math.sqrt(20 / 9.81)
hits = {(name, points): end(ball, name, points, "hit")[1] for name in ("cvode", "rk4", "euler") for points in (21, 201)}
hits["rk45", None] = end(ball, "rk45", None, "hit")[1]
print(f"the first impact of a ball, exactly {exact:.7g}; 0 where there is none")
for (name, points), value in hits.items():
    print(f"  {name:5}", f"{points or 'no number of':>12} points: {value:.7g}")
show("rk4 and rk45 make no event", not any(value for (name, _), value in hits.items() if name.startswith("rk")))
show("euler makes it at the end of an output interval",
     all(abs(hits["euler", n] - 2 / (n - 1) * math.ceil(exact * (n - 1) / 2)) < 0.0101 for n in (21, 201)))
show("cvode locates it to 2e-6", all(abs(hits["cvode", points] - exact) < 2e-6 for points in (21, 201)))
print(f"e^-2 = {math.exp(-2):.4f} by x' = -x")
rows = {points: end(decay, "rk45", points, "x") for points in (5, 21, None)}
for points, (last, value) in rows.items():
    print(f"  rk45  {points or 'no number of':>12} points: {value:.4f} at t = {last:g}")
show("rk45 is wrong by more than 0.7 with 5 and 21 points", all(rows[n][1] - math.exp(-2) > 0.7 for n in (5, 21)))
show("rk45 without a number of points is right to 1e-6", abs(rows[None][1] - math.exp(-rows[None][0])) < 1e-6)
others = [end(decay, name, 21, "x")[1] for name in ("cvode", "rk4")]
show("cvode and rk4 are right to 1e-6", all(abs(value - math.exp(-2)) < 1e-6 for value in others))
sys.exit(not all(seen))
PYTHON
