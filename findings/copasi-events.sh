#!/usr/bin/env bash
# What COPASI (python-copasi 4.48.311, copasi-basico 0.92) does with events that SBML allows, beside libroadrunner 2.10.0.
#
# - If an event changes two conditions of a `piecewise` in rate rules at one instant, as where a mode is a number that
#   three cases read, COPASI executes one of the two and stops with "Internal step limit exceeded". With two cases, or
#   with a parameter of 0 or 1 for each case and products, it goes on.
# - An event whose trigger is n >= 7 fires again at a later event while n, with the rate 0, is 7 exactly, as a
#   counter is. With n >= 6.5, or without the rate rule of n, it does not.
#
# The models are x' = 1 from 0, with events at x = 1, 2 and 3. Exits with 0 while COPASI does so and libroadrunner not.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  copasi-basico==0.92 python-copasi==4.48.311 libroadrunner==2.10.0 2> /dev/null
cd "$folder"
"$folder/venv/bin/python" - 2> /dev/null << 'PYTHON'
import logging
import sys

import basico
import roadrunner

logging.disable(logging.CRITICAL)
APPLY = "<apply><{}/><ci>{}</ci><cn>{}</cn></apply>"


def document(rates, starts, events):
    """SBML of parameters with rates, and of events: a trigger (relation, name, number), and what each assigns."""
    math = '<math xmlns="http://www.w3.org/1998/Math/MathML">{}</math>'.format
    lists = {
        "Parameters": [f'<parameter id="{name}" value="{value}" constant="false"/>' for name, value in starts.items()],
        "Rules": [f'<rateRule variable="{name}">{math(value)}</rateRule>' for name, value in rates.items()],
        "Events": [
            f'<event useValuesFromTriggerTime="false"><trigger initialValue="false" persistent="false">'
            f"{math(APPLY.format(*trigger))}</trigger><listOfEventAssignments>"
            + "".join(f'<eventAssignment variable="{k}">{math(v)}</eventAssignment>' for k, v in assigned.items())
            + "</listOfEventAssignments></event>"
            for trigger, assigned in events
        ],
    }
    content = "".join(f"<listOf{name}>{''.join(parts)}</listOf{name}>" for name, parts in lists.items())
    space = "http://www.sbml.org/sbml/level3/version2/core"
    return f'<sbml xmlns="{space}" level="3" version="2"><model id="m">{content}</model></sbml>'


def last(text, name):
    """The last time that COPASI and libroadrunner reach of 3.5, and the value there."""
    with open("model.xml", "w") as file:
        file.write(text)
    basico.load_model("model.xml")
    table = basico.run_time_course(values=[0, 0.5, 1.5, 2.5, 3.5], r_tol=1e-9, a_tol=1e-12, use_sbml_id=True)
    runner = roadrunner.RoadRunner(text)
    runner.timeCourseSelections = ["time", name]
    other = runner.simulate(0, 3.5, 8)[-1]
    return [(round(float(table.index[-1]), 5), round(float(table[name].iloc[-1]), 5)), tuple(other.round(5).tolist())]


def number(value):
    return f"<cn>{value}</cn>"


def cases(*pairs, other):
    pieces = "".join(f"<piece>{number(rate)}{APPLY.format('eq', 'mode', mode)}</piece>" for mode, rate in pairs)
    return f"<piecewise>{pieces}<otherwise>{number(other)}</otherwise></piecewise>"


turn = [(("geq", "x", 1), {"mode": number(1), "p": number(0), "q": number(1)})]
begin = {"x": 0, "y": 0, "mode": 0, "p": 1, "q": 0}
products = "<apply><plus/><ci>p</ci><apply><times/><cn>-1</cn><ci>q</ci></apply></apply>"
found = {
    name: last(document({"x": number(1), "y": rate}, begin, turn), "y")
    for name, rate in (
        ("three cases", cases((0, 1), (1, -1), other=0)),
        ("two cases", cases((0, 1), other=-1)),
        ("products", products),
    )
}
once = "<apply><plus/><ci>fired</ci><cn>1</cn></apply>"
rate = {"x": number(1)}
for name, level, rates in (
    ("n >= 7", 7, rate | {"n": number(0)}),
    ("n >= 6.5", 6.5, rate | {"n": number(0)}),
    ("no rule", 7, rate),
):
    events = [(("geq", "x", 1), {"n": number(7)}), (("geq", "n", level), {"fired": once})]
    events += [(("gt", "x", time), {"other": number(time)}) for time in (2, 3)]
    found[name] = last(document(rates, {"x": 0, "n": 0, "fired": 0, "other": 0}, events), "fired")
print("COPASI", basico.__version__, "by basico; the last (time, value), and libroadrunner's", roadrunner.__version__)
for name, rows in found.items():
    print(f"{name:12}", *rows)
right = {"three cases": -1.5, "two cases": -1.5, "products": -1.5, "n >= 7": 1.0, "n >= 6.5": 1.0, "no rule": 1.0}
seen = {
    "libroadrunner is right in all": all(found[name][1] == (3.5, value) for name, value in right.items()),
    "COPASI stops at the event where three cases change": found["three cases"][0][0] == 1.0,
    "COPASI counts an event on its threshold again at a later event": found["n >= 7"][0] == (3.5, 2.0),
    "COPASI is right with two cases, with products, beside the threshold, and without the rule":
        all(found[name][0] == (3.5, right[name]) for name in ("two cases", "products", "n >= 6.5", "no rule")),
}
for sentence, holds in seen.items():
    print("yes" if holds else "NO ", sentence)
sys.exit(not all(seen.values()))
PYTHON
