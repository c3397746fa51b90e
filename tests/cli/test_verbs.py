"""The other verbs: validate, schema, doctor, and what holds for all."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib

import pytest
from engines import COMPILER
from shipped import MODELS

import hsdsl
from hsdsl.interface.cli.verbs import VERBS

SLIDING = """hsdsl: 1
modes:
  right: {flow: {x: -1}, transitions: [{when: x <= 0, to: left}]}
  left: {flow: {x: 2}, transitions: [{when: x >= 0, to: right}]}
initial: {mode: right, x: 0.7}
experiment: {until: 3}
"""


def test_all_models_are_valid(command):
    models = sorted(MODELS.glob("*.yaml"))
    assert len(models) >= 7
    answer = command("validate", *models)
    assert answer.code == 0 and answer.out.count("valid") == len(models)


def test_validate_names_every_error_of_every_file(command, model):
    good = MODELS / "digital-control.yaml"
    bad = model("hsdsl: 1\nmodes: {a: {flow: {x: y}}}\ninitial: {mode: b, x: 1}\nexperiment: {until: 1}\n")
    answer = command("validate", good, bad, "--json")
    assert answer.code == 1
    assert [entry["valid"] for entry in answer.json["models"]] == [True, False]
    assert [error["line"] for error in answer.json["errors"]] == [2, 3]


@pytest.mark.parametrize("verb", ["validate", "lint"])
def test_an_unreadable_file_is_among_the_errors_of_all(command, verb, model, tmp_path):
    bad = model("hsdsl: 1\nmodes: {a: {flow: {x: y}}}\ninitial: {mode: a, x: 1}\nexperiment: {until: 1}\n")
    answer = command(verb, tmp_path / "no.yaml", bad, "--json")
    assert answer.code == 2
    errors = [(error["code"], error["path"], error["line"]) for error in answer.json["errors"]]
    assert errors == [("HS111", str(bad), 2), (None, str(tmp_path / "no.yaml"), None)]


def test_complete_answers_in_json(command, model, tmp_path):
    file, out = model(SLIDING), tmp_path / "complete.yaml"
    printed = command("complete", file)
    assert command("complete", file, "--json").json == {"model": str(file), "text": printed.out}
    assert command("complete", file, "--out", out, "--json").json == {"model": str(file), "files": [str(out)]}
    assert out.read_text() == printed.out != ""
    quiet = command("complete", file, "--out", out, "-q")
    assert (quiet.code, quiet.out, quiet.err) == (0, "", "")


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_can_answer_in_json(command, verb):
    assert " --json " in command(verb, "--help").out


def test_schema_is_the_file(command):
    printed = json.loads(command("schema").out)
    assert command("schema", "--json").json == printed
    assert printed == json.loads((MODELS.parent / "schemas" / "model.schema.json").read_text())


def test_doctor(command):
    answer = command("doctor", "--json")
    assert answer.code == 0 and answer.json["engines"] == ["c", "python"][not COMPILER :]
    assert bool(answer.json["compiler"]) == COMPILER
    assert hsdsl.__version__ in command("doctor").out
    declared = tomllib.loads((MODELS.parent / "pyproject.toml").read_text())["project"]["dependencies"]
    assert {re.split("[<>=]", text)[0] for text in declared} == set(answer.json["packages"])


def test_help_imports_no_library():
    helps = [["--help"], *([verb, "--help"] for verb in VERBS)]
    program = (
        "import sys\nfrom hsdsl.interface.cli.verbs import obey\n"
        f"codes = [obey(words) for words in {helps}]\n"
        "print(*codes, *({'numpy', 'sympy', 'pydantic', 'yaml', 'matplotlib', 'rich'} & set(sys.modules)), sep='+')"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "+".join("0" * len(helps))


def test_version(command):
    assert command("--version").out.strip() == f"hsdsl {hsdsl.__version__}"


@pytest.mark.parametrize("arguments", [["runn"], ["run"], ["run", "a", "b"], ["validate"]])
def test_wrong_words(command, arguments):
    assert command(*arguments).code == 2


def test_explain(command):
    error, rule = command("explain", "hs111"), command("explain", "unused-parameter")
    assert error.code == rule.code == 0
    assert error.out.startswith("HS111\n\nA name that nothing defines.\n") and "Use instead" in error.out
    assert rule.out.startswith("HS401 unused-parameter\n\nA parameter that nothing uses.\n")
    assert command("explain", "HS401", "--json").json["page"] in rule.out
    assert command("explain", "HS999").code == 2
