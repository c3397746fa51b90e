"""Models of SBML, imported, against exact solutions."""

from __future__ import annotations

import ast
import random
from collections.abc import Mapping
from importlib.util import find_spec
from math import cosh, exp, gamma
from pathlib import Path

import pytest

import hsdsl
from hsdsl.base import limits
from hsdsl.interface.cli.verbs import obey
from hsdsl.interface.imports.sbml import imported
from hsdsl.interface.imports.sbml.formulas import TAKEN
from hsdsl.interface.imports.sbml.text import readable
from hsdsl.language.source.xml import read_xml

MATH = '<math xmlns="http://www.w3.org/1998/Math/MathML">{}</math>'
SPECIES = (
    '<species id="{}" compartment="C" initialAmount="{}" hasOnlySubstanceUnits="false" boundaryCondition="false"'
    ' constant="false"/>'
)


TAGS: dict[type[ast.AST], str] = {
    **{ast.Add: "plus", ast.Sub: "minus", ast.USub: "minus", ast.Mult: "times", ast.Div: "divide", ast.Pow: "power"},
    **{ast.Lt: "lt", ast.GtE: "geq", ast.Gt: "gt", ast.And: "and", ast.Or: "or", ast.Not: "not"},
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
    assert chosen.message.startswith("the order of simultaneous events of equal priority is drawn by `seed`: ")
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
        ("INF", "infinity"),
        ("x*nowhere", "nothing in this file is called 'nowhere'"),
        ("twice(x)", "no function in this file is called 'twice'"),
        ("quotient(x)", "<quotient> of 1 arguments"),
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
    """What a package adds may change what a model means."""
    text = model(Parameters=parameter("x", 1)).replace('version="2"', 'version="2" xmlns:p="c" p:required="true"')
    with pytest.raises(hsdsl.ModelError, match=r"a model cannot have the package 'p'"):
        of(text)


COMP = """<sbml xmlns="http://www.sbml.org/sbml/level3/version1/core" level="3" version="1"
 xmlns:comp="http://www.sbml.org/sbml/level3/version1/comp/version1" comp:required="true">
<model id="whole"><comp:listOfSubmodels><comp:submodel comp:id="a" comp:modelRef="part"/>
<comp:submodel comp:id="b" comp:modelRef="part"/></comp:listOfSubmodels></model>
<comp:listOfModelDefinitions><comp:modelDefinition id="part"><listOfParameters>
<parameter id="x" value="1" constant="false"/></listOfParameters><listOfRules>{}</listOfRules></comp:modelDefinition>
</comp:listOfModelDefinitions></sbml>"""


def test_submodels_are_written_out_by_libsbml() -> None:
    text = COMP.format(rate("x", "2*x"))
    if find_spec("libsbml") is None:
        with pytest.raises(hsdsl.ModelError, match=r"the package 'comp' \(pip install 'hsdsl\[sbml\]'"):
            of(text)
        return
    final = hsdsl.loads(of(text, "1")).simulate(engine="python").final.state
    assert final == pytest.approx({"a__x": exp(2), "b__x": exp(2)})


@pytest.mark.parametrize(
    "name", [*sorted(TAKEN), "null", "Null", "yes", "on", "lambda", "E", "S", "__", "title", "INF", "Inf", "NaN"]
)
def test_every_name_of_a_file_is_kept_or_renamed(name: str) -> None:
    """As a state, a constant, a function, an argument and an event."""
    twice = "<lambda><bvar><ci>{0}</ci></bvar><apply><plus/><ci>{0}</ci><ci>{0}</ci></apply></lambda>"
    functions = '<functionDefinition id="{}">{}</functionDefinition>'
    head = functions.format("own", MATH.format(twice.format(name)))
    law = MATH.format(f"<apply><ci>own</ci><ci>{name}</ci></apply>")
    text = model(
        FunctionDefinitions=head,
        Parameters=parameter("x", 0) + parameter(name, 2),
        Rules=f'<rateRule variable="x">{law}</rateRule>' + rate(name, "1"),
    )
    assert hsdsl.loads(of(text, outputs={name: "value"})).simulate(engine="python").final.outputs == pytest.approx(
        {f"out_{name}": 4}
    )
    called = MATH.format(f"<apply><ci>{name}</ci><cn>1</cn></apply>")
    text = model(
        FunctionDefinitions=functions.format(name, MATH.format(twice.format("s"))),
        Parameters=parameter("x", 0),
        Rules=f'<rateRule variable="x">{called}</rateRule>',
    )
    assert hsdsl.loads(of(text)).simulate(engine="python").final.state == pytest.approx({"x": 4})
    named = event("x >= 1", {"x": "5"}).replace("<event ", f'<event id="{name}" ')
    text = model(Parameters=parameter("x", 0), Rules=rate("x", "1"), Events=named)
    assert hsdsl.loads(of(text)).simulate(engine="python").final.state["x"] == pytest.approx(6)


def test_arguments_of_functions_may_have_the_names_of_parameters_and_functions() -> None:
    body = "<lambda><bvar><ci>k</ci></bvar><bvar><ci>k_</ci></bvar><bvar><ci>f</ci></bvar>{}</lambda>"
    body = body.format("<apply><minus/><apply><times/><ci>k</ci><ci>k_</ci></apply><ci>f</ci></apply>")
    law = "<apply><ci>f</ci><ci>k_</ci><ci>x</ci><ci>k</ci></apply>"  # k_*x - k
    text = model(
        FunctionDefinitions=f'<functionDefinition id="f">{MATH.format(body)}</functionDefinition>',
        Parameters=parameter("k", 3, True) + parameter("k_", 1, True) + parameter("x", 5),
        Rules=f'<rateRule variable="x">{MATH.format(law)}</rateRule>',
    )
    assert hsdsl.loads(of(text)).simulate(engine="python").final.state["x"] == pytest.approx(3 + 2 * exp(2))


def test_what_a_file_assigns_and_nothing_uses_is_an_output() -> None:
    names = parameter("x", 1) + parameter("half", 0) + parameter("total", 0)
    text = of(model(Parameters=names, Rules=assigned("half", "x/2") + assigned("total", "half + 3") + rate("x", "x")))
    run = hsdsl.loads(text).simulate(engine="python")
    assert run.final.outputs == pytest.approx({"total": exp(2) / 2 + 3}) and "half: x/2" in text


FORMULAS = {
    "((1)*R3 + (-1)*R4)": "R3 - R4",
    "((-1)*r)/c": "-r/c",
    "(((a + b) + c)*2)": "(a + b + c)*2",
    "(a - (b + c))/(d*e)": "(a - (b + c))/(d*e)",
    "(a/(b/c))": "a/(b/c)",
    "((-2)**2)*(x**(-1))": "(-2)**2*x**(-1)",
    "(-(2**2))": "-2**2",
    "((a**b)**c) - (a**(b**c))": "(a**b)**c - a**b**c",
    "(-2)*x - (-3)*y": "-2*x + 3*y",
    "(x > 0 or x < 0) and ((y >= (1)) and z < 2)": "(x > 0 or x < 0) and y >= 1 and z < 2",
    "not ((x) > 0 and y > 0)": "not (x > 0 and y > 0)",
    "select((x), ((a)*(1)), (1/(b)))": "select(x, a, 1/b)",
}


@pytest.mark.parametrize("text", FORMULAS)
def test_formulas_have_no_more_parentheses_than_they_need(text: str) -> None:
    assert readable(text) == FORMULAS[text]


@pytest.mark.parametrize("seed", range(40))
def test_readable_formulas_have_the_same_value_to_the_last_bit(seed: int) -> None:
    rng = random.Random(f"formulas {seed}")

    def made(depth: int) -> str:
        if depth == 0:
            return rng.choice(["0.1", "0.3", "1", "7", "1.7"])
        a, b = made(depth - 1), made(depth - 1)
        return rng.choice([f"({a} + {b})", f"({a} - {b})", f"({a}*{b})", f"({a}/({b} + 9))", f"(-{a})", f"(({a})**2)"])

    for depth in (1, 2, 3, 4, 5):
        text = made(depth)
        assert eval(readable(text)) == eval(text), text  # Python's precedence is the language's


def test_faults_are_in_the_file_that_was_imported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A constant without a value, and a rule that gives a name two values by the way round a kink."""
    file = tmp_path / "wrong.xml"
    rules = "\n" + assigned("y", "x/(2 - 2)") + "\n" + rate("x", "1")
    file.write_text(model(Parameters=parameter("x", 1) + parameter("y", 1), Rules=rules))
    assert obey(["import", str(file), "--until", "1"]) == 1
    said = capsys.readouterr().err
    assert f"{file}:2:" in said and "y: " in said and "<text>" not in said and "assignmentRule" in said


def test_factorials_and_values_that_are_infinite() -> None:
    rules = rate("x", "factorial(3)") + rate("y", "0*y + factorial(c)")
    names = parameter("x", 0) + parameter("y", 0) + parameter("c", 2.5, True)
    bound = '<parameter id="b" value="INF" constant="true"/>'
    text = of(model(Parameters=names + bound, Rules=rules, Events=event("x > b or x >= 6", {"x": "100"})), "1.5")
    final = hsdsl.loads(text).simulate(engine="python").final.state
    assert "# Left out, since every number is finite here: b = inf." in text and "or" not in text.split("event:")[1]
    assert (final["x"], final["y"]) == pytest.approx((103, 1.5 * gamma(3.5)), rel=1e-13)


def test_names_terms_and_notes_become_comments() -> None:
    note = '<notes><body xmlns="http://www.w3.org/1999/xhtml"><p>From the\n paper</p></body></notes>'
    k = parameter("k", 3, True).replace("/>", f' name="growth" sboTerm="SBO:0000009">{note}</parameter>')
    text = of(model(Parameters=k + parameter("x", 1), Rules=rate("x", "k*x")))
    assert "  k: 3  # growth; SBO:0000009; From the paper\n" in text
    assert hsdsl.loads(text).simulate(engine="python").stop.reason == "until"


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
    file.write_text(model(Parameters=parameter("x", 1), Rules=rate("x", "x*nowhere")))
    assert obey(["import", str(file)]) == 1
    shown = capsys.readouterr().err
    assert "nothing in this file is called 'nowhere'" in shown and "the end of the run is not given" in shown
    file.write_text(model(Parameters=parameter("x", 1), Rules=rate("x", "x")))
    assert obey(["import", str(file), "--until", "1", "--urgent"]) == 2
    assert obey(["run", str(file)]) == 1 and "`hsdsl import` makes one of a file of SBML" in capsys.readouterr().err
    file.write_text(file.read_text().replace("<sbml", '<!DOCTYPE sbml [<!ENTITY a "b">]><sbml'))
    assert obey(["import", str(file), "--until", "1"]) == 1 and "document type" in capsys.readouterr().err


def test_the_count_of_transitions_is_that_of_validate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Transitions that arm and trigger an event are not the file's."""
    out = tmp_path / "events.yaml"
    (tmp_path / "events.xml").write_text(
        model(Parameters=parameter("x", 1), Rules=rate("x", "x"), Events=event("x >= 2", {"x": "1"}))
    )
    assert obey(["import", str(tmp_path / "events.xml"), "--until", "1", "--out", str(out)]) == 0
    assert ": 1 mode, 1 transition\n" in capsys.readouterr().err
    assert obey(["validate", str(out)]) == 0 and "1 mode, 1 transition\n" in capsys.readouterr().out


def test_a_flag_that_is_neither_true_nor_false_is_refused() -> None:
    """A word such as `no` is no boolean of XML."""
    text = model(Parameters=parameter("x", 1), Rules=rate("x", "x"), Events=event("x >= 2", {"x": "1"}))
    with pytest.raises(hsdsl.ModelError, match="'useValuesFromTriggerTime': expected true or false, got 'no'"):
        of(text.replace('TriggerTime="true"', 'TriggerTime="no"'))


def test_the_unit_of_time_alone_is_kept() -> None:
    """A file may give the unit of time and no other."""
    text = model(Parameters=parameter("x", 1), Rules=rate("x", "x")).replace("<model", '<model timeUnits="second"')
    assert hsdsl.loads(of(text)).system.units == {"t": "s"}
