"""What holds the project together: layers at run time, nothing unregistered, undocumented or stale."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import generate
import pytest

import hsdsl
from hsdsl.base.errors import CODES
from hsdsl.engine import integrators

ROOT = Path(__file__).parent.parent.parent
SOURCES = sorted((ROOT / "hsdsl").rglob("*.py"))
TABLES = sorted((ROOT / "hsdsl").rglob("*.toml"))
HEAVY = ("sympy", "scipy", "pydantic", "matplotlib", "yaml", "typer", "pandas")


def modules_after(statement: str) -> set[str]:
    """Import in a fresh process and return the top-level packages that this brought in."""
    program = f"{statement}\nimport sys\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_simulation_needs_no_heavy_library():
    assert modules_after("import hsdsl.engine.simulate").isdisjoint(HEAVY)


def test_importing_the_package_alone_is_light():
    assert modules_after("import hsdsl").isdisjoint(HEAVY)


def test_the_probe_for_heavy_libraries_sees_them():
    assert "sympy" in modules_after("import hsdsl.language.system")


WITHOUT_RUNS = [name for name in generate.PAGES if name != "../models.md"]  # `.ci/run` checks that one


@pytest.mark.parametrize("name", WITHOUT_RUNS)
def test_reference_page_says_what_the_code_says(name):
    assert generate.written(name) == generate.render(name), "run python docs/generate.py"


def test_every_integrator_is_registered():
    tables = set()
    for info in pkgutil.iter_modules(integrators.__path__):
        module = importlib.import_module(f"hsdsl.engine.integrators.{info.name}")
        tables |= {value for value in vars(module).values() if isinstance(value, integrators.ButcherTableau)}
    assert tables == set(integrators.INTEGRATORS.values())


def test_integrators_are_registered_under_their_names():
    assert all(name == table.name for name, table in integrators.INTEGRATORS.items())


def mentions(paths: Iterable[Path]) -> Counter[str]:
    texts = (
        path.read_text(encoding="utf-8", errors="replace") for path in paths if path.is_file() and path.suffix != ".pyc"
    )
    # lint rules have the codes above
    return Counter(code for text in texts for code in re.findall(r"\bHS[0-3]\d{2}\b", text))


def test_error_codes_are_registered_and_used():
    used = {code for code in mentions([*SOURCES, *TABLES]) if code < "HS400"}  # above: lint rules
    assert used == set(CODES)


def test_every_error_code_is_tested():
    assert set(CODES) - set(mentions((ROOT / "tests").rglob("*.*"))) == set()


def calls(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
    names = {f.id for f in functions if isinstance(f, ast.Name)}
    return names | {f.attr for f in functions if isinstance(f, ast.Attribute)}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_text_is_evaluated(path):
    # Generated text is executed in these places, over numbered names only.
    places = ("backends/python.py", "backends/taylor.py", "integrators/stepper.py")
    allowed = {"exec"} if any(map(path.match, places)) else set()
    assert calls(path) & {"eval", "exec", "parse_expr", "safe_load", "unsafe_load"} <= allowed


@pytest.mark.parametrize("path", sorted((ROOT / "models").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_model_has_a_title_and_says_what_is_known_of_it(path):
    system = hsdsl.load(path).system
    assert system.title and system.reference


def test_architecture_page_has_the_layers_that_are_checked():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", page, flags=re.MULTILINE))
    checked = {
        each["containers"][0].removeprefix("hsdsl."): each["layers"] for each in contracts if "containers" in each
    }
    storeys = checked.pop("hsdsl")
    assert re.findall(r"^  (\w+)/ ", page, flags=re.MULTILINE) == storeys[1:]
    for storey, layers in checked.items():
        named = [set(re.findall(r"`(\w+)`", re.sub(r"\(.*?\)", "", layer))) for layer in rows[storey].split(";")]
        assert named == [set(re.split(" [|:] ", layer)) for layer in layers], storey


def test_architecture_page_names_files_that_there_are():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    known = {"/" + place for line in listed.split() for place in (line, *map(str, Path(line).parents))}
    named = set(re.findall(r"`((?:hsdsl|docs|tests|models|examples)/[\w./-]+|[\w./-]+\.(?:py|c|h|m|js|md))`", page))
    assert [name for name in sorted(named) if not any(path.endswith("/" + name.rstrip("/")) for path in known)] == []


def readme_command(mark: str) -> str:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = re.findall(rf"^<!-- {mark} -->\n```sh\n(.*?)\n```$", text, flags=re.MULTILINE | re.DOTALL)
    assert len(found) == 1
    return found[0]


@pytest.mark.parametrize("mark", ["setup-and-run", "setup-and-test"])
def test_readme_command_starts_from_nothing_and_is_what_the_ci_runs(mark):
    assert readme_command(mark).startswith("python3 -m venv .venv && ")
    assert f"run_readme_command {mark}" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
