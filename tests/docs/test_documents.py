"""The examples of README and docs, run as a reader would, in a folder that has only `models/` to begin with.

Marks, each on the line before a fenced block:

    <!-- file: NAME -->          the block becomes the file NAME
    <!-- run -->                 the block is run: Python, or lines that begin with `$ ` with what they print below
    <!-- run: exit N -->         as `run`, with another exit code than 0
    <!-- run with: A B -->       as `run`, where these programs and modules are installed
    <!-- not run: REASON -->     a block with commands that is not run
    <!-- prints -->              what the Python block before printed

`...` in expected output stands for anything, and blanks do not count. `hsdsl` and Python run in this process. Every
block of commands or of Python has a mark, and `hsdsl` in the running text names verbs and options that exist.
"""

from __future__ import annotations

import ast
import contextlib
import doctest
import inspect
import io
import re
import shlex
import shutil
import subprocess
import sys
import traceback
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from subprocess import PIPE, STDOUT
from typing import NamedTuple

import pytest
from typer import Context

import hsdsl
from hsdsl.base import plugins
from hsdsl.interface.cli import main
from hsdsl.interface.cli.verbs import VERBS, command

ROOT = Path(__file__).parent.parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]
BLOCK = re.compile(
    r"^(?P<indent> *)(?:<!-- (?P<mark>[^>\n]*?) -->\n\s*)?```(?P<language>\w*)\n(?P<text>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
SHELL = ("console", "sh", "bash")
MARKED = (*SHELL, "python")
MARK = re.compile(r"file: \S+|run(: exit \d+| with: .+)?|not run: \w.+|prints|setup-and-(run|test)")
INLINE = re.compile(r"`hsdsl ([^`]+)`")
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


class Block(NamedTuple):
    kind: str
    argument: str
    language: str
    text: str


def blocks(page: Path) -> list[Block]:
    found = []
    for match in BLOCK.finditer(page.read_text(encoding="utf-8")):
        kind, _, argument = (match["mark"] or "").partition(": ")
        lines = [line.removeprefix(match["indent"]) for line in match["text"].splitlines(keepends=True)]
        found.append(Block(kind, argument, match["language"], "".join(lines)))
    return found


def commands(text: str) -> Iterator[tuple[str, str]]:
    """Split a console block into commands and what they print; without `$ ` each line is a command."""
    if "$ " not in text:
        yield from ((line, "...\n") for line in text.replace("\\\n", " ").splitlines())
        return
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        line, _, output = part.partition("\n")
        yield line, output


def run(line: str) -> tuple[int, str]:
    """Run a command in the present folder: its exit code and what it prints, both streams in one."""
    line, _, target = line.partition(" > ")
    program, *arguments = shlex.split(line)
    if program == "hsdsl":
        code, output = run_hsdsl(arguments)
    else:
        program = sys.executable if program == "python" else program
        done = subprocess.run([program, *arguments], stdout=PIPE, stderr=STDOUT, text=True, check=False)
        code, output = done.returncode, done.stdout
    if target:
        Path(target).write_text(output, encoding="utf-8")
    return code, "" if target else output


def run_hsdsl(arguments: list[str]) -> tuple[int, str]:
    stream = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(stream), contextlib.redirect_stderr(stream):
        patch.setattr(sys, "argv", ["hsdsl", *arguments])
        with pytest.raises(SystemExit) as stop:
            main()
    code = stop.value.code
    return (code if isinstance(code, int) else 0), stream.getvalue()


def run_python(text: str) -> tuple[int, str]:
    stream = io.StringIO()
    try:
        with contextlib.redirect_stdout(stream):
            exec(compile(text, "<example>", "exec"), {"__name__": "__main__"})
    except Exception:
        traceback.print_exc(file=stream)
        return 1, stream.getvalue()
    return 0, stream.getvalue()


def installed(name: str) -> bool:
    return shutil.which(name) is not None or find_spec(name) is not None


def assert_prints(expected: str, got: str) -> None:
    checker = doctest.OutputChecker()
    if expected != "...\n" and not checker.check_output(expected, got, FLAGS):
        pytest.fail(checker.output_difference(doctest.Example("", expected), got, FLAGS))


RUNNABLE = [name for name in NAMES if any(block.kind.startswith("run") for block in blocks(ROOT / name))]


@pytest.fixture
def reader(tmp_path, monkeypatch):
    """A reader's folder, and a terminal of 120 columns without colours."""
    for name in ("models", "tests"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("TERM", "dumb")
    monkeypatch.setenv("MPLBACKEND", "agg")
    for place in plugins.TABLES.values():  # what a page registers is for that page
        table = plugins.located(place)
        monkeypatch.setattr(table, "_given", dict(table._given))
    yield tmp_path
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.mark.parametrize("name", RUNNABLE)
def test_examples_run_and_print_what_the_page_says(name, reader):
    printed = ""
    for kind, argument, language, text in blocks(ROOT / name):
        expected_code = int(argument.removeprefix("exit ")) if kind == "run" and argument else 0
        if kind == "file":
            (reader / argument).write_text(text, encoding="utf-8")
        elif kind == "prints":
            assert_prints(text, printed)
        elif kind in ("run", "run with"):
            if kind == "run with" and not all(map(installed, argument.split())):
                continue
            if language == "python":
                code, printed = run_python(text)
                assert code == expected_code, printed
                continue
            for line, expected in commands(text):
                code, output = run(line)
                assert code == expected_code, f"{line}\n{output}"
                assert_prints(expected, output)


@pytest.mark.parametrize("name", NAMES)
def test_every_block_of_commands_has_a_mark(name):
    for block in blocks(ROOT / name):
        mark = block.kind + (f": {block.argument}" if block.argument else "")
        if block.language in MARKED:
            assert MARK.fullmatch(mark), f"{name}: expected a mark above this block, got '{mark}':\n{block.text}"


WHOLE = re.compile(r"^hsdsl: 1$.*^(modes|automata):", re.MULTILINE | re.DOTALL)
MODELS = [
    pytest.param(block.text, id=name)
    for name in NAMES
    for block in blocks(ROOT / name)
    if block.language == "yaml" and block.kind != "file" and WHOLE.search(block.text) and "mistakes" not in name
]


@pytest.mark.parametrize("text", MODELS)
def test_whole_models_are_models(text):
    """Models that a page shows without a run; the others are run."""
    assert hsdsl.loads(text).system.modes


@pytest.mark.parametrize("name", NAMES)
def test_commands_in_the_text_exist(name):
    """Verbs and options in the running text; values are not tried."""
    text = (ROOT / name).read_text(encoding="utf-8")
    for found in INLINE.findall(re.sub(r"\s*\n\s*", " ", text)):
        verb, *words = found.split()
        if not re.fullmatch(r"[a-z]+", verb) or name == "docs/reference/mistakes.md":
            continue
        assert verb in VERBS, f"{name}: hsdsl {found}"
        verb = command(verb)
        options = {flag for p in verb.get_params(Context(verb)) for flag in (*p.opts, *p.secondary_opts)}
        for word in words:
            option = word.partition("=")[0].strip(",;.|[]")
            assert not option.startswith("--") or option in options, f"{name}: hsdsl {found}"


ROOTED = sorted(page for page in ROOT.glob("*.md"))  # mkdocs checks the links of the others
LINK = re.compile(r"\]\(([^()\s]+)\)")


@pytest.mark.parametrize("page", ROOTED, ids=lambda page: page.name)
def test_links_lead_to_files_and_headings(page):
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        path, _, heading = link.partition("#")
        if "://" in link:
            continue
        target = (page.parent / path) if path else page
        assert target.exists(), f"{page.name}: {link}"
        assert not heading or heading in headings(target), f"{page.name}: {link}"


def headings(page: Path) -> set[str]:
    """The anchors of a page's headings, as mkdocs names them."""
    lines = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", line).strip().lower()) for line in lines}


def test_reasons_of_verdicts_on_their_page_are_those_of_the_code():
    page = (ROOT / "docs" / "how-to" / "unknown.md").read_text(encoding="utf-8")
    trees = [
        ast.parse(path.read_text(encoding="utf-8")) for path in (ROOT / "hsdsl" / "engine" / "simulate").rglob("*.py")
    ]
    code = "\n".join(
        node.value
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    )
    cells = re.findall(r"^\| (`.*?`) \| ", page, flags=re.MULTILINE)
    reasons = [reason for cell in cells for reason in re.findall(r"`(.+?)`(?:, |$)", cell)]
    parts = [part.split() for reason in reasons for part in reason.split("...")]
    assert len(reasons) > 10
    for words in parts:  # of one string, or of two that follow each other
        halves = ((" ".join(words[:i]), " ".join(words[i:])) for i in range(len(words) + 1))
        assert any(one in code and other in code for one, other in halves), words


def test_tutorial_readme_and_how_tos_have_examples_that_run():
    how_tos = {name for name in NAMES if name.startswith("docs/how-to/")}
    assert set(RUNNABLE) >= {"README.md", "docs/tutorial.md", *how_tos - {"docs/how-to/model.md"}}


PLUG_IN = {"method": "integrator", "rule": "lint-rule", "target": "export-target", "peer": "peer", "metric": "metric"}


@pytest.mark.parametrize("module", PLUG_IN)
def test_the_code_of_the_example_package_is_that_of_its_how_to(module):
    code = (ROOT / "examples" / "plug-in" / "lab" / f"{module}.py").read_text(encoding="utf-8")
    assert code in (ROOT / "docs" / "how-to" / f"{PLUG_IN[module]}.md").read_text(encoding="utf-8")


OF_THE_PACKAGE = ("look", "check_scene", "check", "view", "sizes")  # methods that other modules call


def test_the_reference_of_python_has_every_public_name_with_its_arguments():
    page = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    for name in set(hsdsl.__all__) - {"__version__"}:
        assert f"### hsdsl.{name}\n" in page
    for kind in (hsdsl.Model, hsdsl.Execution):
        for name, member in vars(kind).items():
            if name.startswith("_") or not inspect.isfunction(member) or name in OF_THE_PACKAGE:
                continue
            part = page.partition(f"#### {kind.__name__}.{name}\n")[2].partition("\n#")[0]
            given = inspect.signature(member).parameters
            assert all(argument in part for argument in given if argument != "self"), f"{kind.__name__}.{name}"
