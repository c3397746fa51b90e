"""Typical mistakes of new users, and the answer to each. `HSDSL_WRITE_GOLDEN=1` writes the answers anew.

Records are without the number of errors, which is the last line of an answer.
"""

import os
import re
import sys
from pathlib import Path

import pytest
import yaml

from hsdsl.base.names import counted
from hsdsl.interface.cli import main

FOLDER = Path(__file__).parent
DATA = yaml.safe_load((FOLDER / "mistakes.yaml").read_text(encoding="utf-8"))
ANSWERS = FOLDER / "mistakes.txt"
CASES = {f"{group}: {case['title']}": case for group, cases in DATA["groups"].items() for case in cases}
MARK = "### "


def known():
    """The answers on record, by case."""
    parts = ANSWERS.read_text(encoding="utf-8").split(MARK)[1:] if ANSWERS.exists() else []
    return {part.split("\n", 1)[0]: part.split("\n", 1)[1].rstrip("\n") + "\n" for part in parts}


def ending(answer):
    """The last lines of an answer with errors in a file."""
    count = len(re.findall(r":\d+: error HS", answer))
    return f"\n{counted(count, 'error')}\n" if count else ""


@pytest.fixture
def answered(tmp_path, monkeypatch, capsys):
    """What the command line says to a case."""

    def tell(case):
        text = DATA["base"]
        if "for" in case:
            assert text.count(case["for"]) >= 1
            text = text.replace(case["for"], case["write"], 1)
        (tmp_path / "model.yaml").write_text(case.get("file", text), encoding="utf-8")
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["hsdsl", *case.get("command", ["validate", "model.yaml"])])
        with pytest.raises(SystemExit) as ended:
            main()
        printed = capsys.readouterr()
        assert printed.out == ""
        return ended.value.code, printed.err

    return tell


def test_there_are_enough_and_no_two_are_called_the_same():
    assert len(CASES) == sum(map(len, DATA["groups"].values())) >= 60
    assert list(known()) == list(CASES)


@pytest.mark.skipif("HSDSL_WRITE_GOLDEN" not in os.environ, reason="writes the answers")
def test_write(answered):
    answers = {name: answered(case)[1] for name, case in CASES.items()}
    records = (f"{MARK}{name}\n{answer.removesuffix(ending(answer))}" for name, answer in answers.items())
    ANSWERS.write_text("".join(records), encoding="utf-8")


@pytest.mark.parametrize("name", CASES)
def test_each_mistake_is_told(answered, name):
    code, printed = answered(CASES[name])
    assert code in (1, 2)
    assert printed == known()[name] + ending(known()[name])


@pytest.mark.parametrize("name", CASES)
def test_each_answer_says_what_to_write(name):
    """A hint for the first error of each, but where the sentence itself leaves nothing to say."""
    first = re.split("\n\n(?! |Error)", known()[name])[0]
    assert "hint: " in first or CASES[name].get("plain"), first
    assert "Traceback" not in first
