"""Lint and `--fix` on models nobody wrote for them: all other tests' models, random documents, and a large grid."""

from pathlib import Path
from random import Random
from time import process_time

import pytest
from fuzz import generators
from lint.grid import grid

from hsdsl.analysis.lint import UNDECIDED, lint, selected
from hsdsl.analysis.lint.fix import fix
from hsdsl.base.errors import ModelError

ROOT = Path(__file__).parents[2]
MODELS = [p for p in sorted(ROOT.glob("tests/conformance/cases/*.yaml")) if not p.name.endswith(".expect.yaml")]
MODELS += [*sorted(ROOT.glob("models/*.yaml")), *sorted(ROOT.glob("tests/convergence/scenes/*.yaml"))]
RANDOM = 120
STRUCTURE = selected(["names", "shape", "experiment"])


def test_every_rule_is_decided_for_every_model_of_the_tests_and_places_are_in_the_file():
    assert len(MODELS) > 50
    for path in MODELS:
        lines = path.read_text(encoding="utf-8").splitlines()
        for finding in lint(path).findings:
            assert finding.code != UNDECIDED, (path.name, finding.message)
            line = lines[finding.span.line - 1]
            assert finding.span.column >= 1 and finding.span.column + finding.span.length <= len(line) + 1
            assert finding.text == line


def test_random_documents(tmp_path):
    """`--fix` leaves a model without anything to fix, keeps its comments, and has nothing to do the second time."""
    path, sound, fixed = tmp_path / "model.yaml", 0, 0
    for seed in range(RANDOM):
        path.write_bytes(generators.document(Random(seed)))
        before = path.read_bytes()
        try:
            report, remedied = fix(path)
        except ModelError:
            assert path.read_bytes() == before
            continue
        sound, fixed = sound + 1, fixed + remedied
        assert not any(finding.fix or finding.code == UNDECIDED for finding in report.findings)
        assert path.read_bytes().count(b"#") == before.count(b"#")
        after = path.read_bytes()
        assert fix(path)[1] == 0 and path.read_bytes() == after
    assert sound >= RANDOM / 8 and fixed


def test_a_grid_of_cells_is_clean():
    assert lint("grid.yaml", STRUCTURE, text=grid(6).encode()).findings == ()


def test_a_misspelt_cell_is_found_in_a_large_grid():
    broken = grid(6).replace("{when: x >= 3, to: c3_2}", "{when: x >= 3, to: c2_2}")
    found = lint("grid.yaml", STRUCTURE, text=broken.encode()).findings
    assert [finding.code for finding in found] == ["HS422"]
    assert "'c2_2'" in found[0].message


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("# hsdsl: ignore[HS401] once more\n" * 25_000 + "parameters: {a: 1}\n", 0),
        ("reference:\n" + "- {source: '# hsdsl: ignore'}  # hsdsl: ignore[HS401]\n" * 12_000, 12_000),
        ("# hsdsl: ignore[" + ",".join(f"HT{n:05}" for n in range(100_000)) + "]\n", 100_000),
        ("# hsdsl: ignore " * 20_000 + "\n", 20_000),
    ],
    ids=["stacked", "beside texts", "long", "in one line"],
)
def test_many_comments_are_read_in_linear_time(text, count):
    model = text + "hsdsl: 1\nmodes: {m: {flow: {x: 1}}}\ninitial: {mode: m, x: 0}\nexperiment: {until: 1}\n"
    began = process_time()
    assert len(lint("model.yaml", text=model.encode()).findings) == count
    assert process_time() - began < 15  # seconds; pairs of them would take minutes
