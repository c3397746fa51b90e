"""The examples of README and docs, run as a reader would, in a folder that has only `models/` to begin with.

Marks, each on the line before a fenced block:

    <!-- file: NAME -->     the block becomes the file NAME
    <!-- run -->            the block is run: Python, or lines that begin with `$ ` with what they print below
    <!-- run: exit N -->    as `run`, with another exit code than 0
    <!-- prints -->         what the Python block before printed

`...` in expected output stands for anything, and blanks do not count.
"""

from __future__ import annotations

import doctest
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from subprocess import PIPE, STDOUT

import pytest

ROOT = Path(__file__).parent.parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^<!-- (file|run|prints)(?:: (.*?))? -->\n```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def blocks(page: Path) -> list[tuple[str, str, str, str]]:
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def commands(text: str) -> Iterator[tuple[str, str]]:
    """Split a console block into commands and what they print."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, output = part.partition("\n")
        yield command, output


def run(arguments: list[str], folder: Path) -> tuple[int, str]:
    environment = os.environ | {"COLUMNS": "120", "NO_COLOR": "1", "TERM": "dumb"}
    environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{environment['PATH']}"
    done = subprocess.run(arguments, cwd=folder, env=environment, stdout=PIPE, stderr=STDOUT, text=True, check=False)
    return done.returncode, done.stdout


def assert_prints(expected: str, got: str) -> None:
    checker = doctest.OutputChecker()
    if not checker.check_output(expected, got, FLAGS):
        pytest.fail(checker.output_difference(doctest.Example("", expected), got, FLAGS))


RUNNABLE = [page for page in PAGES if any(kind == "run" for kind, *_ in blocks(page))]


@pytest.mark.parametrize("page", RUNNABLE, ids=lambda page: str(page.relative_to(ROOT)))
def test_examples_run_and_print_what_the_page_says(page, tmp_path):
    (tmp_path / "models").symlink_to(ROOT / "models")
    printed = ""
    for kind, argument, language, text in blocks(page):
        wanted = int(argument.removeprefix("exit ")) if kind == "run" and argument else 0
        if kind == "file":
            (tmp_path / argument).write_text(text, encoding="utf-8")
        elif kind == "prints":
            assert_prints(text, printed)
        elif language == "python":
            code, printed = run([sys.executable, "-c", text], tmp_path)
            assert code == wanted, printed
        else:
            for command, expected in commands(text):
                code, output = run(shlex.split(command), tmp_path)
                assert code == wanted, output
                assert_prints(expected, output)


def test_tutorial_and_readme_have_examples_that_run():
    assert {page.name for page in RUNNABLE} >= {"README.md", "tutorial.md"}
