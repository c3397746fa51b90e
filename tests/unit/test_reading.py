# pyright: basic
"""Reading a right model: what is imported for it, and that what it depends on is known to the cache of programs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import hsdsl
from hsdsl.base.errors import ModelError

ROOT = Path(__file__).parents[2]
RIGHT = [*sorted((ROOT / "models").glob("*.yaml")), ROOT / "models" / "parts" / "rooms.yaml"]
READ = """
import json, sys
from hsdsl.language.elaborate import elaborate
from hsdsl.mathematics.lower import lower
for path in sys.argv[1:]:
    lower(elaborate(path))
print(json.dumps({name: getattr(module, "__file__", None) for name, module in sys.modules.items() if "hsdsl" in name}))
"""
UNUSUAL = """hsdsl: 1
parameters: {a: 1, b: 'min(a, 2)', c: {value: "max(a, b)", min: 0}}
inputs: {u: {times: [0, 1], values: [0, "min(a, b)"], hold: linear}}
modes:
  m:
    flow: {x: 'max(x, u)', dx: 1}
    domain: ["min(x, 9) <= 5"]
    transitions: [{event: x >= 1 and dx < 3, delay: 2, priority: 2*x, reset: {x: "0"}}]
initial: {mode: m, x: 0, dx: 0}
experiment: {until: 1, samples: {every: 1/2}, scale: {x: 2}}
reference: {set: {initial.x: 1}, transitions: [1, {time: 2, edge: m->m}]}
"""


@pytest.fixture(scope="module")
def imported(tmp_path_factory) -> dict[str, str]:
    """The modules of the package that a process has which reads right models, with their files."""
    unusual = tmp_path_factory.mktemp("models") / "unusual.yaml"
    unusual.write_text(UNUSUAL)
    given = [str(path) for path in (*RIGHT, unusual)]
    answer = subprocess.run([sys.executable, "-c", READ, *given], capture_output=True, text=True, check=True)
    return json.loads(answer.stdout)


def test_what_explains_a_wrong_file_is_not_imported(imported):
    assert "hsdsl.language.elaborate" in imported
    assert not [name for name in imported if name.startswith("hsdsl.language.diagnosis")]


def test_a_wrong_file_is_explained():
    with pytest.raises(ModelError) as raised:
        hsdsl.loads(UNUSUAL.replace("reset:", "resets:"))
    assert raised.value.diagnostics[0].hint == "did you mean 'reset'?"
    assert "hsdsl.language.diagnosis.documents" in sys.modules


def test_the_key_of_a_program_has_all_that_it_is_made_by(imported):
    from hsdsl.mathematics import program_cache

    package = Path(hsdsl.__file__).parent
    folders = [package / name for name in program_cache._READERS]
    assert all(folder.is_dir() for folder in folders)
    made_by = [Path(file) for file in imported.values() if file]
    outside = [file for file in made_by if not any(file.is_relative_to(folder) for folder in folders)]
    assert {file.relative_to(package).as_posix() for file in outside} == {"__init__.py"}


def test_a_state_beside_unknowns_of_equations_is_not_misspelt():
    model = """hsdsl: 1
solve: {unknowns: [force], equations: ["2*force == 1"]}
modes:
  a: {flow: {x: force}}
  b: {flow: {forces: force}}
initial: {mode: a, x: 0}
experiment: {until: 1}
"""
    assert hsdsl.loads(model).simulate().stop.reason == "until"
