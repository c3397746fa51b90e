"""The notebooks of the documentation: their cells run, what they print is what they show, and nothing is fetched."""

from __future__ import annotations

import re

import pytest
from writing import notebooks

PATHS = notebooks.paths()
NAMES = [path.stem for path in PATHS]


def printed(notebook):
    texts = [[out.get("text", []) for out in cell.get("outputs", [])] for cell in notebook["cells"]]
    return ["".join(line for text in each for line in text) for each in texts]


def kinds(notebook):
    return [[out["output_type"] for out in cell.get("outputs", [])] for cell in notebook["cells"]]


def test_there_are_three():
    assert len(PATHS) >= 3


@pytest.mark.slow
@pytest.mark.parametrize("path", PATHS, ids=NAMES)
def test_cells_show_what_the_notebook_has(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    kept = notebooks.read(path)
    found = notebooks.executed(kept)
    assert printed(found) == printed(kept) and kinds(found) == kinds(kept)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", PATHS, ids=NAMES)
def test_a_notebook_is_one_that_jupyter_reads(path):
    notebook = notebooks.read(path)
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    assert len({cell["id"] for cell in notebook["cells"]}) == len(notebook["cells"])
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    assert all(cell["outputs"] or "=" in notebooks.source(cell) for cell in code)


@pytest.mark.parametrize("path", PATHS, ids=NAMES)
def test_a_page_has_all_cells_and_reads_no_network(path):
    page = notebooks.page(path)
    assert page.startswith("# ")
    for cell in notebooks.read(path)["cells"]:
        assert notebooks.source(cell).rstrip() in page
    assert not re.search(r"(src|href)=[\"']?https?:", page) and "<script" not in page
    assert not re.search(r"<div class=\"output\">[^\n]*\n(?!\n)", page)  # an output is one line: none ends it early


def test_a_cell_shows_its_last_value_prints_and_figures():
    cells = [
        {"cell_type": "code", "source": ["x = 2\n", "print(x)\n", "x + 1"], "id": "a", "metadata": {}},
        {
            "cell_type": "code",
            "source": ["from matplotlib import pyplot\n", "pyplot.plot([x]);"],
            "id": "b",
            "metadata": {},
        },
    ]
    first, second = notebooks.executed({"cells": cells})["cells"]
    assert [out["output_type"] for out in first["outputs"]] == ["stream", "execute_result"]
    assert first["outputs"][1]["data"] == {"text/plain": ["3"]}
    assert [out["output_type"] for out in second["outputs"]] == ["display_data"]


def test_a_cell_that_fails_is_an_error():
    cell = {"cell_type": "code", "source": ["1/0"], "id": "a", "metadata": {}}
    with pytest.raises(ZeroDivisionError):
        notebooks.executed({"cells": [cell]})
