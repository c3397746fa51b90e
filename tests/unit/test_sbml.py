"""Models of SBML, converted as `benchmarks/sbml.py` does, against exact solutions."""

# pyright: basic
from __future__ import annotations

import sys
from math import cosh, exp
from pathlib import Path

import pytest
import yaml

import hsdsl

pytest.importorskip("libsbml")
sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

from sbml_convert import convert_text
from sbml_math import NotExpressible

MATH = '<math xmlns="http://www.w3.org/1998/Math/MathML">{}</math>'
SPECIES = (
    '<species id="{}" compartment="C" initialAmount="{}" hasOnlySubstanceUnits="false" boundaryCondition="false"'
    ' constant="false"/>'
)


def math(text: str) -> str:
    """The MathML of a formula."""
    import libsbml

    written = libsbml.writeMathMLToString(libsbml.parseL3Formula(text))
    return written.split("?>", 1)[1]


def parameter(name: str, value: float, constant: bool = False) -> str:
    return f'<parameter id="{name}" value="{value}" constant="{str(constant).lower()}"/>'


def rate(name: str, formula: str) -> str:
    return f'<rateRule variable="{name}">{math(formula)}</rateRule>'


def event(trigger: str, changes: dict[str, str], delay: str = "") -> str:
    """An event that reads values at its trigger and is made also where the trigger turns false before."""
    lasting = f"<delay>{math(delay)}</delay>" if delay else ""
    assigned = "".join(f'<eventAssignment variable="{n}">{math(f)}</eventAssignment>' for n, f in changes.items())
    begins = f'<trigger initialValue="true" persistent="true">{math(trigger)}</trigger>'
    return (
        f'<event useValuesFromTriggerTime="true">{begins}{lasting}'
        f"<listOfEventAssignments>{assigned}</listOfEventAssignments></event>"
    )


def model(**lists: str) -> str:
    """A file of Level 3 with the lists that are given."""
    content = "".join(f"<listOf{name}>{items}</listOf{name}>" for name, items in lists.items())
    space = "http://www.sbml.org/sbml/level3/version2/core"
    return f'<sbml xmlns="{space}" level="3" version="2"><model>{content}</model></sbml>'


COMPARTMENT = '<compartment id="C" size="2" spatialDimensions="3" constant="{}"/>'
REACTION = (
    '<reaction id="decay" reversible="false"><listOfReactants><speciesReference species="A" stoichiometry="2"'
    ' constant="true"/></listOfReactants><listOfProducts><speciesReference species="B" stoichiometry="1"'
    f' constant="true"/></listOfProducts><kineticLaw>{MATH}</kineticLaw></reaction>'
)
LAW = "<apply><times/><ci>k</ci><ci>A</ci></apply>"

# what is in the file, what is recorded, and its value at the end, t = 2
CASES = {
    "a reaction moves amounts, names mean concentrations": (
        model(
            Compartments=COMPARTMENT.format("true"),
            Species=SPECIES.format("A", 4) + SPECIES.format("B", 0),
            Parameters=parameter("k", 0.5, True),
            Reactions=REACTION.format(LAW),
        ),
        {"A": "concentration", "B": "amount"},
        {"A": 2 * exp(-1), "B": 2 - 2 * exp(-1)},
    ),
    "a compartment that grows dilutes": (
        model(
            Compartments=COMPARTMENT.format("false"),
            Species=SPECIES.format("A", 4),
            Rules=rate("C", "1"),
        ),
        {"A": "value", "C": "value"},
        {"A": 1, "C": 4},
    ),
    "a condition in a formula switches": (
        model(Parameters=parameter("x", 0), Rules=rate("x", "piecewise(2, x < 1, 1)")),
        {"x": "value"},
        {"x": 2.5},
    ),
    "an algebraic rule determines what nothing else does": (
        model(
            Parameters=parameter("x", 1) + parameter("y", 0),
            Rules=rate("x", "-x") + f"<algebraicRule>{math('x + 2*y - 4')}</algebraicRule>",
        ),
        {"y": "value"},
        {"y": 2 - exp(-2) / 2},
    ),
    "initial values use others, functions are the language's own": (
        model(
            FunctionDefinitions='<functionDefinition id="twice">'
            + MATH.format("<lambda><bvar><ci>s</ci></bvar><apply><times/><cn>2</cn><ci>s</ci></apply></lambda>")
            + "</functionDefinition>",
            Parameters=parameter("x", 3) + parameter("y", 0) + parameter("z", 0),
            InitialAssignments=f'<initialAssignment symbol="y">{math("twice(x) + z")}</initialAssignment>',
            Rules=rate("x", "1") + rate("y", "0") + f'<assignmentRule variable="z">{math("x^2")}</assignmentRule>',
        ),
        {"y": "value"},
        {"y": 15},
    ),
    "rare functions are written out": (
        model(
            Parameters=parameter("x", 0),
            Rules=rate("x", "0*x + sech(0) + ceil(1.5) + quotient(-7, 2) + rem(-7, 2) + root(3, 8) + log10(100)"),
        ),
        {"x": "value"},
        {"x": 2 * (1 / cosh(0) + 2 - 3 - 1 + 2 + 2)},
    ),
    "an event waits": (
        model(
            Parameters=parameter("x", 0) + parameter("y", 0),
            Rules=rate("x", "1"),
            Events=event("x >= 1", {"y": "x + 1"}, delay="0.5"),
        ),
        {"y": "value"},
        {"y": 2},
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_converted_models_have_the_values_of_their_solution(case: str) -> None:
    """Each file is converted without code around it, and runs to the exact values at its end."""
    text, outputs, right = CASES[case]
    document = convert_text(text, outputs, until=2.0)
    run = hsdsl.loads(yaml.safe_dump(document)).simulate(engine="python")
    assert run.verdict.theorem == "holds"
    assert {name: run.final.outputs[f"out_{name}"] for name in right} == pytest.approx(right, abs=1e-8)


@pytest.mark.parametrize(
    ("formula", "feature"),
    [("delay(x, 1)", "delay equations"), ("factorial(x)", "factorial"), ("INF", "infinity")],
)
def test_what_has_no_words_is_named(formula: str, feature: str) -> None:
    """A feature that the language has no words for is named."""
    with pytest.raises(NotExpressible, match=feature):
        convert_text(model(Parameters=parameter("x", 0), Rules=rate("x", formula)))
