"""Documents to mathematics: what names mean, how edges are made, and the messages where something is wrong."""

import hashlib
import time
from fractions import Fraction

import pytest
import sympy as sp

from hsdsl.base.errors import STEP_AND_TOLERANCE, ModelError, UsageError
from hsdsl.language.elaborate import elaborate, parameter_expression
from hsdsl.language.elaborate.derived import only
from hsdsl.language.system import TIME, HybridSystem, KnownState, KnownTransition, Reference

X, V, A = (sp.Symbol(n, real=True) for n in "xva")
HEAD = "hsdsl: 1\n"
TAIL = "initial: {mode: A, x: 0, v: 1}\nexperiment: {until: 1}\n"


def system(text: str, path="m.yaml") -> HybridSystem:
    return elaborate(path, text=text.encode())


def model(mode: str, rest: str = "", tail: str = TAIL) -> HybridSystem:
    return system(f"{HEAD}modes:\n  A:\n    flow: {{x: v, v: -x}}\n{mode}{rest}{tail}")


def codes(text: str) -> list[str]:
    with pytest.raises(ModelError) as raised:
        system(text)
    return [d.code for d in raised.value.diagnostics]


SIDES = [("x >= a", X - A, A - X), ("x > a", X - A, A - X), ("x <= a", A - X, X - A), ("x < a", A - X, X - A)]


@pytest.mark.parametrize(("text", "guard", "wall"), SIDES)
def test_surfaces_are_negative_inside(text, guard, wall):
    made = model(f"    domain: ['{text}']\n    transitions: [{{when: '{text}', to: A}}]\n", "parameters: {a: 1}\n")
    (mode,) = made.modes
    surface = mode.edges[0].surface
    assert (surface.residual, surface.left, surface.right, surface.text) == (guard, X, A, text)
    assert mode.walls[0].residual == wall


def test_resets_see_names_and_keep_the_rest():
    made = model("    transitions: [{when: x >= 1, to: A, reset: {v: -v/2}, if: v > 0, priority: 3}]\n")
    edge = made.modes[0].edges[0]
    assert edge.target_states == ("x", "v") and edge.reset == (X, -V / 2) and edge.reset_texts == ("x", "-v/2")
    assert edge.condition == sp.Gt(V, 0) and edge.priority == 3


def test_names_of_edges():
    lines = ["{when: x >= 1, to: A}", "{when: x >= 2, to: B}", "{when: x >= 3, to: A}"]
    lines += ["{when: x >= 4, to: A, name: 'A->A#3'}", "{when: x >= 5, to: A}", "{when: x >= 6, to: A, name: my edge!}"]
    body = "    transitions:\n" + "".join(f"      - {line}\n" for line in lines) + "  B: {final: true}\n"
    edges = model(body).modes[0].edges
    assert [e.name for e in edges] == ["A->A", "A->B", "A->A#2", "A->A#3", "A->A#4", "my edge!"]
    assert edges[1].target_states == ("x", "v") and edges[1].reset == (X, V)


def test_lets_are_lexical_and_substituted():
    rest = "parameters: {a: 2}\ninputs: {u: a*t}\nlet: {p: x + a, q: 2*p, r: 1}\noutputs: {o: q, w: u}\n"
    made = model("    let: {p: 7, s: q + p}\n    domain: [s >= r]\n", rest)
    mode = made.modes[0]
    assert mode.walls[0].left == 2 * X + 2 * A + 7
    assert mode.outputs == (2 * X + 2 * A, A * TIME)


def test_a_let_may_not_be_captured():
    made = model("    domain: [q >= 0]\n    let: {p: v}\n", "let: {p: x, q: p}\n")
    assert made.modes[0].walls[0].left == X


def test_outputs_are_none_where_a_state_is_missing():
    made = model("  B:\n    flow: {y: 1}\n", "let: {p: x + v}\noutputs: {e: p, c: 3, t2: t**2, d: y}\n")
    assert made.modes[0].outputs == (X + V, 3, TIME**2, None)
    assert made.modes[1].outputs == (None, 3, TIME**2, sp.Symbol("y", real=True))


def test_outputs_are_read_in_each_mode():
    made = model(
        "    let: {p: x, q: p + v}\n    outputs: {own: q, e: 7}\n"
        "  B:\n    flow: {y: 1}\n    let: {p: 2*y}\n    outputs: {last: p}\n  C: {flow: {z: 1}}\n",
        "let: {p: 3, top: p}\noutputs: {e: p, f: q*p, g: top}\n",
    )
    y = sp.Symbol("y", real=True)
    assert made.outputs == ("e", "f", "g", "own", "last")
    assert made.modes[0].outputs == (7, (X + V) * X, 3, X + V, None)
    assert made.modes[1].outputs == (2 * y, None, 3, None, 2 * y)
    assert made.modes[2].outputs == (3, None, 3, None, None)


@pytest.mark.parametrize(
    ("mode", "rest", "expected"),
    [
        ("    outputs: {o: y}\n", "", ["HS117"]),  # a state of another mode
        ("    outputs: {o: p}\n", "", ["HS111"]),  # a `let` of another mode
        ("    outputs: {x: 1}\n", "", ["HS301"]),
        ("    outputs: {y: 1}\n", "", ["HS301"]),  # a column cannot be both
        ("    outputs: {o: 1/0}\n", "", ["HS118"]),
        ("", "outputs: {o: pq}\n", ["HS111"]),
        ("    let: {p: 0}\n", "outputs: {o: 1/p}\n", ["HS118"]),  # without a value in this mode alone
        ("    let: {p: nothing}\n", "outputs: {o: p}\n", ["HS111"]),  # the fault is reported where it is
        ("  C: {final: true, outputs: {o: 1}}\n", "", ["HS315"]),
    ],
)
def test_outputs_of_modes_with_faults(mode, rest, expected):
    body = f"modes:\n  A:\n    flow: {{x: 1, v: 1}}\n{mode}  B: {{flow: {{y: 1}}, let: {{p: y}}}}\n"
    assert codes(HEAD + body + rest + TAIL) == expected


def test_a_let_of_another_mode():
    with pytest.raises(ModelError) as raised:
        model("  B:\n    flow: {y: p}\n  C: {flow: {z: 1}, let: {p: z}}\n")
    (fault,) = raised.value.diagnostics
    assert fault.message == "'p' is a `let` name of other modes" and "`let` of the whole model" in str(fault.hint)
    assert str(raised.value) == f"m.yaml:6:15: error HS111: {fault.message} ({fault.hint})"
    with pytest.raises(ModelError) as raised:
        model("  B: {flow: {y: 1}, let: {p: y}}\n", "let: {q: 2*p}\noutputs: {p: p}\n")
    (fault,) = raised.value.diagnostics
    assert fault.message == "'p' is a `let` name of modes, and what all modes share cannot use it"


def test_a_misspelt_let_of_a_mode_in_an_output():
    with pytest.raises(ModelError) as raised:
        model("    let: {force: -x}\n", "outputs: {o: forse*v}\n")
    assert [d.hint for d in raised.value.diagnostics] == ["did you mean 'force'?"]


def test_a_let_is_checked_in_the_modes_that_use_it():
    assert model("  B:\n    flow: {y: 1}\n", "let: {p: x + v}\n").modes[1].flow == (1,)
    lines = HEAD + "let: {p: x, q: p}\nmodes:\n  A: {flow: {x: q, v: 1}}\n  B: {flow: {y: q}}\n" + TAIL
    assert codes(lines) == ["HS117"]


@pytest.mark.parametrize(
    "name", ["E", "I", "S", "N", "Q", "beta", "gamma", "lambda", "zeta", "class", "def", "pi2", "é"]
)
def test_any_identifier_is_a_name(name):
    made = system(
        f"{HEAD}parameters: {{p_{name}: 1}}\nmodes: {{A: {{flow: {{{name}: -{name}*p_{name}}}}}}}\n"
        f"initial: {{mode: A, {name}: 1}}\nexperiment: {{until: 1}}\n"
    )
    assert made.modes[0].states == (name,)
    assert made.modes[0].flow[0].free_symbols == {sp.Symbol(name, real=True), sp.Symbol(f"p_{name}", real=True)}


def test_yaml_words_are_words():
    made = system(HEAD + "modes: {off: {flow: {y: 1}}, on: {flow: {y: no}}}\nparameters: {no: 010}\n"
                  "initial: {mode: off, y: 1e-3}\nexperiment: {until: 1}\n")  # fmt: skip
    assert [m.name for m in made.modes] == ["off", "on"]
    assert made.parameters[0].value == 10 and made.initial.values == (("y", sp.Rational(1, 1000)),)


def test_parameters_are_expressions_of_earlier_ones():
    made = model(
        "", "parameters: {a: 1/3, b: {value: 2*a, unit: m, min: 0, max: a + 1, about: twice}}\nunits: {x: m}\n"
    )
    b = made.parameters[1]
    assert (b.value, b.text, b.unit, b.minimum, b.maximum, b.about) == (2 * A, "2*a", "m", 0, A + 1, "twice")
    assert made.units == {"x": "m", "b": "m"}


def test_empty_maps_and_lists_are_legal():
    empty = "parameters:\ninputs: {}\nlet:\noutputs:\nunits:\nreference:\n"
    made = model("    transitions:\n    domain: []\n    let:\n  N: {flow: {}}\n  M:\n    flow:\n", empty)
    assert made.modes[1].states == () and made.modes[2].states == () and made.reference == ()


def test_sampled_inputs(tmp_path):
    (tmp_path / "u.csv").write_text("time, u\n0,1e-3\n0.5, -2\n")
    (tmp_path / "in").mkdir()
    rest = (
        "parameters: {a: 2}\ninputs:\n  u: {file: in/../u.csv, hold: linear}\n"
        "  w: {times: [0, 1/3, 1.5], values: [1, 2, -3]}\n  z: {times: [0, a], values: [1, 2*a]}\n"
    )
    text = f"{HEAD}modes:\n  A:\n    flow: {{x: u, v: w + z}}\n{rest}{TAIL}"
    made = system(text, tmp_path / "m.yaml")
    u, w, z = made.inputs
    assert (u.hold, u.times, u.values) == ("linear", (0, Fraction(1, 2)), (Fraction(1, 1000), -2))
    assert (w.hold, w.times, w.values) == ("zero", (0, Fraction(1, 3), Fraction(3, 2)), (1, 2, -3))
    assert (z.times, z.values) == ((0, A), (1, 2 * A))
    assert made.modes[0].flow[0] == sp.Symbol("u", real=True)
    before = made.digest
    assert system(text, tmp_path / "m.yaml").digest == before
    (tmp_path / "u.csv").write_text("time,u\n0,1\n")
    assert system(text, tmp_path / "m.yaml").digest != before


@pytest.mark.parametrize("column", ["p (kPa)", "flow, of air", 'the "third"', "ü_4", "q"])
def test_an_input_takes_the_column_that_it_names(tmp_path, column):
    header = '"p (kPa)",time, "flow, of air" ,"the ""third""",ü_4,q'
    (tmp_path / "log.csv").write_text(f"{header}\n11,0,21,31,41,51\n12,2.5,22,32,42,52\n", encoding="utf-8")
    quoted = column.replace('"', '\\"')
    text = f'{HEAD}inputs: {{q: {{file: log.csv, column: "{quoted}"}}}}\nmodes: {{A: {{flow: {{x: q, v: 1}}}}}}\n{TAIL}'
    (made,) = system(text, tmp_path / "m.yaml").inputs
    number = 1 + ["p (kPa)", "flow, of air", 'the "third"', "ü_4", "q"].index(column)
    assert (made.name, made.times, made.values) == ("q", (0, Fraction(5, 2)), (10 * number + 1, 10 * number + 2))


@pytest.mark.parametrize(
    ("entry", "hint"),
    [
        ("{file: log.csv, column: Forse}", "did you mean 'Force'?"),
        ("{file: log.csv}", "name its column: {file: log.csv, column: ...}"),
        ("{file: log.csv, col: Force}", "did you mean 'column'?"),
        ("{column: Force}", "write file: and the name of a CSV file"),
    ],
)
def test_a_column_that_is_not_there_is_answered_with_what_to_write(tmp_path, entry, hint):
    (tmp_path / "log.csv").write_text("time,Force,Torque (N m),p,q,r,s,w,z\n0,1,1,1,1,1,1,1,1\n")
    text = f"{HEAD}inputs: {{u: {entry}}}\nmodes: {{A: {{flow: {{x: u, v: 1}}}}}}\n{TAIL}"
    with pytest.raises(ModelError) as refusal:
        elaborate(tmp_path / "m.yaml", text=text.encode())
    assert hint in [fault.hint for fault in refusal.value.diagnostics]


def test_data_may_not_be_linked_from_outside(tmp_path):
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / "u.csv").write_text("time,u\n0,1\n")
    (folder / "u.csv").symlink_to(tmp_path / "u.csv")
    text = f"{HEAD}inputs: {{u: {{file: u.csv}}}}\nmodes: {{A: {{flow: {{x: u, v: 1}}}}}}\n{TAIL}"
    with pytest.raises(ModelError) as raised:
        system(text, folder / "m.yaml")
    assert [d.code for d in raised.value.diagnostics] == ["HS317"]


def test_experiment_and_initial_are_expressions():
    tail = "parameters: {a: 2}\ninitial: {mode: A, x: a/4, v: 0}\n"
    tail += "experiment: {until: 40*pi, samples: [0, a, pi], step: a/100}\n"
    made = model("", tail=tail)
    assert made.initial.values == (("x", A / 4), ("v", 0))
    assert made.experiment.until == 40 * sp.pi and made.experiment.samples == (0, A, sp.pi)
    assert made.experiment.step == A / 100 and made.experiment.tolerance is None and made.experiment.scheme is None


def test_references_have_numbers_as_text():
    rest = (
        "reference:\n  - set: {initial.x: -0.4, experiment.method: rk4}\n    source: a book\n    trust: 1e-9\n"
        "    transitions: [1/3, {time: 0.5, edge: hit, before: {v: 1}}]\n    states: [{time: 2*pi, mode: A, x: 1}]\n"
    )
    made = model("    transitions: [{name: hit, when: x >= 1, to: A}]\n", rest)
    assert made.reference == (
        Reference(
            {"initial.x": "-0.4", "experiment.method": "rk4"},
            "a book",
            "1e-9",
            (KnownTransition("1/3"), KnownTransition("0.5", "hit", {"v": "1"})),
            (KnownState("2*pi", "A", {"x": "1"}),),
        ),
    )


def test_digest_is_of_the_bytes():
    text = f"{HEAD}modes: {{A: {{flow: {{x: 1, v: 1}}}}}}\n{TAIL}"
    assert system(text).digest == hashlib.sha256(text.encode()).hexdigest()


def test_step_and_tolerance_have_their_own_code():
    text = HEAD + "modes: {A: {flow: {}}}\ninitial: {mode: A}\nexperiment: {until: 1, step: 0.1, tolerance: 1e-6}\n"
    assert codes(text) == [STEP_AND_TOLERANCE]


def test_a_broken_definition_is_reported_once():
    text = f"{HEAD}parameters: {{a: 1 +}}\nlet: {{p: a, q: p + x}}\nmodes: {{A: {{flow: {{x: q*a, v: p}}}}}}\n{TAIL}"
    assert codes(text) == ["HS102"]


def test_files_that_cannot_be_read(tmp_path):
    for path in (tmp_path / "no.yaml", tmp_path):
        with pytest.raises(UsageError) as raised:
            elaborate(path)
        assert str(path) in str(raised.value)


class TestOverrides:
    made = model("", "parameters: {omega: 1, c: 2*omega}\ninputs: {u: t}\n")

    def test_expressions(self):
        omega = sp.Symbol("omega", real=True)
        assert parameter_expression(self.made, "0.9", "--set c") == sp.Rational(9, 10)
        assert parameter_expression(self.made, "-2*omega + pi", "--set c") == sp.pi - 2 * omega

    @pytest.mark.parametrize(
        ("text", "sentence", "hint"),
        [
            ("omga", "--set c: nothing here is called 'omga'", "did you mean 'omega'?"),
            ("x", "--set c: 'x' is a state; only parameters can be used here", None),
            ("t", "--set c: 't' is the time; only parameters can be used here", None),
            ("c", "--set c: 'c' cannot be used here: only earlier parameters can", None),
            ("1/0", "--set c: nothing can be divided by 0", None),
            ("nan", "--set c: `nan` is not a finite number", "every number is finite here"),
            ("", "--set c: an expression is missing", "write a number or an expression"),
            ("2^3", "--set c: `^` is not an operator of the language", "write `**` for a power"),
            (
                "omega > 1",
                "--set c: expected a number, got the condition `omega > 1`",
                "write a mode for each case, or select(c, a, b): a where c > 0, else b; select(t - 1, 1, 0) is a step",
            ),
        ],
    )
    def test_faults_are_sentences(self, text, sentence, hint):
        with pytest.raises(UsageError) as raised:
            parameter_expression(self.made, text, "--set c", allowed=["omega"])
        assert (str(raised.value), raised.value.hint) == (sentence, hint)


def test_large_models_are_read_quickly():
    side = 25
    lines = [HEAD, "modes:\n"]
    for i in range(side):
        for j in range(side):
            lines.append(
                f"  M{i}_{j}:\n    flow: {{x: v, v: -x - {i}*v/100, w: sin(x) + {j}*cos(v)**2}}\n    transitions:\n"
            )
            for k, m in ((i + 1, j), (i, j + 1), (i - 1, j), (i, j - 1)):
                to = f"M{k % side}_{m % side}"
                lines.append(
                    f"      - {{when: x - {k}*v >= {m}, if: v > 0 and w < 3, to: {to}, reset: {{v: -0.9*v}}}}\n"
                )
    lines.append("initial: {mode: M0_0, x: 0, v: 0, w: 0}\nexperiment: {until: 1}\n")
    began = time.process_time()
    made = system("".join(lines))
    assert len(made.modes) == side**2
    assert time.process_time() - began < 20


def test_nobody_reads_more_than_five_hundred_errors():
    parameters = "".join(f"  p{i}: q{i}\n" for i in range(900))
    modes = "modes: {A: {flow: {x: 1, v: 1}}}\n"
    assert codes(f"{HEAD}parameters:\n{parameters}{modes}{TAIL}") == ["HS111"] * 500


@pytest.mark.parametrize("before", ["\ufeff", "# comment\n", "---\n", "%YAML 1.2\n---\n"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("end", ["", "\n", "\n...\n", "\n\n# comment"])
def test_ways_to_write_a_file(before, line_end, end):
    text = f"{before}{HEAD}modes: {{A: {{flow: {{x: v, v: -x}}}}}}\n{TAIL.strip()}{end}"
    assert system(text.replace("\n", line_end)).modes[0].states == ("x", "v")


@pytest.mark.parametrize(
    ("header", "hint"),
    [
        ("time;u", "separated by commas"),
        ("time\tu", "separated by commas"),
        ("t,u", "called `time`"),
        ("time,v", "column: ..."),
        ("time,u,u", "got 'u' twice"),
        ("time,u, time", "got 'time' twice"),
    ],
)
def test_a_header_of_samples_is_told_what_it_should_be(tmp_path, header, hint):
    (tmp_path / "u.csv").write_text(f"{header}\n0,1\n1,2\n")
    text = f"{HEAD}inputs: {{u: {{file: u.csv}}}}\nmodes: {{A: {{flow: {{x: u, v: 1}}}}}}\n{TAIL}"
    with pytest.raises(ModelError) as refusal:
        elaborate(tmp_path / "m.yaml", text=text.encode())
    (fault,) = refusal.value.diagnostics
    assert fault.code == "HS312" and hint in f"{fault.message} {fault.hint}"


SCENE = """hsdsl: 1
parameters: {r: 0.1}
let: {up: x + r}
modes:
  A: {flow: {x: 1}, let: {foot: up}, transitions: [{when: x >= 1, to: B, reset: {y: 0}}]}
  B: {flow: {x: 1, y: 1}, let: {foot: y}}
scene:
  - point: [x, t]
  - line: [[0, 0], [up, foot], [1, y]]
  - {circle: [x, 0], radius: r}
  - spring: [[0, 0], [x, 0]]
  - {box: [x, 0], width: 1, height: 2}
initial: {mode: A, x: 0}
experiment: {until: 2}
"""


def test_scenes_are_read_in_each_mode_like_outputs():
    made = system(SCENE)
    y, r = (sp.Symbol(n, real=True) for n in "yr")
    assert [(shape.kind, shape.points, shape.numbers) for shape in made.scene] == [
        ("point", 1, 2),
        ("line", 3, 6),
        ("circle", 1, 3),
        ("spring", 2, 4),
        ("box", 1, 5),
    ]
    rest = (X, 0, r, 0, 0, X, 0, X, 0, 1, 2, 0)
    assert made.modes[0].scene == (X, TIME, 0, 0, X + r, X + r, 1, None, *rest)
    assert made.modes[1].scene == (X, TIME, 0, 0, X + r, y, 1, y, *rest)


def test_slices_keep_what_they_can_of_a_scene():
    """Without y, which nothing else needs, its coordinates have no value."""
    sliced = only(system(SCENE), ["x"])
    assert sliced.modes[1].states == ("x",) and len(sliced.modes[1].scene) == 20
    assert sliced.modes[1].scene[5] is None and sliced.modes[1].scene[7] is None and sliced.modes[1].scene[0] == X
