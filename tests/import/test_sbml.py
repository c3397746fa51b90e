"""Models of SBML, imported, against exact solutions."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from math import cosh, exp
from pathlib import Path

import pytest

import hsdsl
from hsdsl.base import limits
from hsdsl.interface.cli.verbs import obey
from hsdsl.interface.imports.sbml import imported
from hsdsl.language.source.xml import read_xml

MATH = '<math xmlns="http://www.w3.org/1998/Math/MathML">{}</math>'
SPECIES = (
    '<species id="{}" compartment="C" initialAmount="{}" hasOnlySubstanceUnits="false" boundaryCondition="false"'
    ' constant="false"/>'
)


TAGS: dict[type[ast.AST], str] = {
    **{ast.Add: "plus", ast.Sub: "minus", ast.USub: "minus", ast.Mult: "times", ast.Div: "divide", ast.Pow: "power"},
    **{ast.Lt: "lt", ast.GtE: "geq", ast.Gt: "gt", ast.And: "and", ast.Not: "not"},
}
SYMBOLS = {"time": "symbols/time", "delay": "symbols/delay", "rateOf": "symbols/rateOf"}
OWN = ("twice", "clipped")  # functions of the files


def math(text: str) -> str:
    """The MathML of a formula, written as in Python."""
    return MATH.format(tree(ast.parse(text, mode="eval").body))


def tree(node: ast.expr) -> str:
    """The MathML of a part of it."""
    match node:
        case ast.Name(id="INF"):
            return "<infinity/>"
        case ast.Name(id=name):
            return symbol(name) if name in SYMBOLS else f"<ci> {name} </ci>"
        case ast.Constant(value=value):
            return f"<cn>{value}</cn>"
        case ast.Call(func=ast.Name(id="piecewise"), args=[value, condition, other]):
            piece = f"<piece>{tree(value)}{tree(condition)}</piece>"
            return f"<piecewise>{piece}<otherwise>{tree(other)}</otherwise></piecewise>"
        case ast.Call(func=ast.Name(id="root"), args=[degree, base]):
            return f"<apply><root/><degree>{tree(degree)}</degree>{tree(base)}</apply>"
        case ast.Call(func=ast.Name(id=name), args=arguments):
            head = symbol(name) if name in SYMBOLS else f"<ci>{name}</ci>" if name in OWN else f"<{name}/>"
            return f"<apply>{head}{''.join(map(tree, arguments))}</apply>"
        case ast.BinOp(left=left, op=op, right=right) | ast.Compare(left=left, ops=[op], comparators=[right]):
            return f"<apply><{TAGS[type(op)]}/>{tree(left)}{tree(right)}</apply>"
        case ast.BoolOp(op=op, values=values):
            return f"<apply><{TAGS[type(op)]}/>{''.join(map(tree, values))}</apply>"
        case ast.UnaryOp(op=op, operand=operand):
            return f"<apply><{TAGS[type(op)]}/>{tree(operand)}</apply>"
        case _:
            raise ValueError(ast.unparse(node))


def symbol(name: str) -> str:
    """A symbol of SBML."""
    return f'<csymbol encoding="text" definitionURL="http://www.sbml.org/sbml/{SYMBOLS[name]}">{name}</csymbol>'


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
        model(Compartments=COMPARTMENT.format("false"), Species=SPECIES.format("A", 4), Rules=rate("C", "1")),
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
            Rules=rate("x", "1") + rate("y", "0") + f'<assignmentRule variable="z">{math("x**2")}</assignmentRule>',
        ),
        {"y": "value"},
        {"y": 15},
    ),
    "rare functions are written out": (
        model(
            Parameters=parameter("x", 0),
            Rules=rate("x", "0*x + sech(0) + ceiling(1.5) + quotient(-7, 2) + rem(-7, 2) + root(3, 8) + log(100)"),
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
    run = hsdsl.loads(of(text, outputs=outputs)).simulate(engine="python")
    assert run.verdict.theorem == "holds"
    assert {name: run.final.outputs[f"out_{name}"] for name in right} == pytest.approx(right, abs=1e-8)


def of(text: str, until: str = "2", outputs: Mapping[str, str] | None = None) -> str:
    """The model's text for the text of a file."""
    return imported(read_xml("model.xml", text.encode(), 100), until, outputs)


LEVEL_2 = f"""<?xml version="1.0" encoding="UTF-8"?>
<sbml xmlns="http://www.sbml.org/sbml/level2/version4" level="2" version="4"><model id="m">
<listOfCompartments><compartment id="C" size="3"/></listOfCompartments>
<listOfSpecies><species id="A" compartment="C" initialConcentration="5"/></listOfSpecies>
<listOfParameters><parameter id="k" value="9"/></listOfParameters>
<listOfReactions><reaction id="r"><listOfReactants><speciesReference species="A"/></listOfReactants>
<kineticLaw>{math("C*k*A")}<listOfParameters><parameter id="k" value="0.25"/></listOfParameters></kineticLaw>
</reaction></listOfReactions></model></sbml>"""


def test_a_file_of_level_2_has_the_defaults_of_its_level() -> None:
    """Parameters and compartments are constant, a reference counts once, and local parameters are those of the law."""
    text = of(LEVEL_2)
    assert hsdsl.loads(text).simulate().final.state["A"] == pytest.approx(5 * exp(-0.5), abs=1e-8)
    assert "r_k: 0.25" in text and "t: s" in text and "A: mol/L" in text


def test_names_of_the_language_are_renamed_and_reported() -> None:
    """A name that the language has gets one that nothing has."""
    names = parameter("t", 2) + parameter("t_", 1, True) + parameter("select", 3, True)
    text = of(model(Parameters=names, Rules=rate("t", "select + t_")))
    assert "t -> t__, select -> select_" in text
    assert hsdsl.loads(text).simulate().final.state["t__"] == pytest.approx(2 + 2 * (3 + 1))


def test_events_keep_how_they_are_made() -> None:
    """Trigger, delay and persistence."""
    given = event("x >= 1 and x < 1.2", {"y": "x"}, delay="0.5").replace('persistent="true"', 'persistent="false"')
    text = of(model(Parameters=parameter("x", 0) + parameter("y", 7), Rules=rate("x", "1"), Events=given))
    assert "persistent: false" in text
    assert hsdsl.loads(text).simulate().final.state["y"] == 7


def test_what_is_taken_for_granted_is_told_by_every_run() -> None:
    first, second = (
        event("time > 1", {"p": value}).replace("</event>", f"<priority>{math('3')}</priority></event>")
        for value in ("1", "2")
    )
    constraint = f"<constraint>{math('p < 5')}</constraint>"
    text = model(Parameters=parameter("p", 0), Events=first + second, Constraints=constraint)
    run = hsdsl.loads(of(text)).simulate()
    unchecked, chosen = (warning for warning in run.warnings if warning.code == "HS707")
    assert unchecked.message.startswith("the SBML constraints of line 1 are not checked: write them under `domain`")
    assert "have one priority: where SBML chooses at random, the first in the file goes first" in chosen.message
    assert all(len(warning.message.split()) <= 25 for warning in run.warnings)
    assert hsdsl.loads(of(model(Parameters=parameter("p", 0), Events=first))).simulate().warnings == ()


def test_units_are_kept() -> None:
    """Defined units, and those of the model."""
    units = (
        '<unitDefinition id="per_min"><listOfUnits><unit kind="second" exponent="-1" scale="0" multiplier="60"/>'
        '</listOfUnits></unitDefinition><unitDefinition id="nM"><listOfUnits><unit kind="mole" scale="-9" exponent="1"'
        ' multiplier="1"/><unit kind="litre" exponent="-1" scale="0" multiplier="1"/></listOfUnits></unitDefinition>'
    )
    k = parameter("k", 3, True).replace("/>", ' units="per_min"/>')
    x = parameter("x", 1).replace("/>", ' units="nM"/>')
    text = model(UnitDefinitions=units, Parameters=k + x, Rules=rate("x", "-k*x"))
    system = hsdsl.loads(of(text.replace("<model>", '<model timeUnits="second">'))).system
    assert system.units == {"t": "s", "k": "(60.0*s)**(-1)", "x": "nmol*L**(-1)"}


@pytest.mark.parametrize(
    ("formula", "feature"),
    [
        ("delay(x, 1)", "delay equations"),
        ("factorial(x)", "factorial"),
        ("INF", "infinity"),
        ("x*nowhere", "a name that is nowhere: nowhere"),
        ("twice(x)", "a function that is nowhere: twice"),
    ],
)
def test_what_has_no_words_is_refused_with_its_place(formula: str, feature: str) -> None:
    """A feature that the language has no words for is named, and its element."""
    text = model(Parameters=parameter("x", 0), Rules="\n\n" + rate("x", formula))
    with pytest.raises(hsdsl.ModelError, match=feature) as error:
        of(text)
    (found,) = error.value.diagnostics
    assert found.code == "HS334" and found.span is not None
    assert found.span.line == 3 or formula == "twice(x)"


def test_required_packages_are_refused() -> None:
    """Submodels change what a model means."""
    text = model(Parameters=parameter("x", 1)).replace('version="2"', 'version="2" xmlns:comp="c" comp:required="true"')
    with pytest.raises(hsdsl.ModelError, match=r"the package 'comp' \(have its submodels written out"):
        of(text)


def test_functions_that_double_are_bounded() -> None:
    """A chain of functions that would write out to a formula without end is refused."""
    chain = ""
    for i in range(60):
        call = f"<apply><ci>f{i - 1}</ci><ci>s</ci></apply>" if i else "<ci>s</ci>"
        piece = f"<apply><plus/>{call}{call}</apply><apply><gt/><ci>s</ci><cn>0</cn></apply>"
        body = f"<lambda><bvar><ci>s</ci></bvar><piecewise><piece>{piece}</piece></piecewise></lambda>"
        chain += f'<functionDefinition id="f{i}">{MATH.format(body)}</functionDefinition>'
    rule = rate("x", "1").replace("<cn>1</cn>", "<apply><ci>f59</ci><ci>x</ci></apply>")
    with limits.applied(limits.Limits(values=3000)), pytest.raises(hsdsl.ModelError, match="parts"):
        of(model(FunctionDefinitions=chain, Parameters=parameter("x", 1), Rules=rule))


def assigned(name: str, formula: str) -> str:
    """An assignment rule."""
    return f'<assignmentRule variable="{name}">{math(formula)}</assignmentRule>'


@pytest.mark.parametrize("count", [2, 40])
def test_rules_that_double_are_bounded(count: int) -> None:
    """Initial values through a chain of rules are refused where they have no end, and circles."""
    names = "".join(parameter(f"a{i}", 1) for i in range(count + 1)) + parameter("x", 0)
    start = f'<initialAssignment symbol="x">{math(f"a{count}")}</initialAssignment>'
    rules = "".join(assigned(f"a{i + 1}", f"a{i} + a{i}") for i in range(count)) + rate("x", "1") + rate("a0", "1")
    text = model(Parameters=names, InitialAssignments=start, Rules=rules)
    if count > 2:
        with pytest.raises(hsdsl.ModelError, match="characters"):
            of(text)
        return
    assert hsdsl.loads(of(text)).simulate().final.state["x"] == pytest.approx(4 + 2)
    circle = text.replace(rate("a0", "1"), assigned("a0", "a2"))
    with pytest.raises(hsdsl.ModelError, match="circle"):
        of(circle)


def test_the_command_imports_sbml(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The command writes a model that runs, and says what is missing."""
    file = tmp_path / "growth.xml"
    file.write_text(model(Parameters=parameter("x", 1), Rules=rate("x", "x")))
    assert obey(["import", str(file), "--until", "1", "--out", str(tmp_path / "growth.yaml"), "--quiet"]) == 0
    assert hsdsl.load(tmp_path / "growth.yaml").simulate().final.state["x"] == pytest.approx(exp(1))
    assert obey(["import", str(file)]) == 2 and "--until" in capsys.readouterr().err
    assert obey(["import", str(file), "--until", "1", "--urgent"]) == 2
    assert obey(["run", str(file)]) == 1 and "`hsdsl import` makes one of a file of SBML" in capsys.readouterr().err
    file.write_text(file.read_text().replace("<sbml", '<!DOCTYPE sbml [<!ENTITY a "b">]><sbml'))
    assert obey(["import", str(file), "--until", "1"]) == 1 and "document type" in capsys.readouterr().err
