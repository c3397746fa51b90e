"""The notebooks of the documentation: executed here, and shown as pages by the hooks of mkdocs.

PYTHONPATH=docs python -m writing.notebooks    execute docs/notebooks/*.ipynb and keep what they show

A notebook is run as plain Python, cell by cell: neither Jupyter nor a network is needed.
"""

from __future__ import annotations

import ast
import base64
import io
import json
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[1] / "notebooks"
DOTS = 72  # an inch, of figures
Cell = dict[str, Any]


def paths() -> list[Path]:
    """The notebooks, by name."""
    return sorted(FOLDER.glob("*.ipynb"))


def read(path: Path) -> dict[str, Any]:
    """Read a notebook."""
    return json.loads(path.read_text(encoding="utf-8"))


def source(cell: Cell) -> str:
    """The text of a cell."""
    return "".join(cell["source"])


def executed(notebook: dict[str, Any]) -> dict[str, Any]:
    """Return the notebook with the outputs of its cells, run in their order in one namespace."""
    import matplotlib

    matplotlib.use("agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    cells: list[Cell] = []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            number = 1 + sum(each["cell_type"] == "code" for each in cells)
            cell = {**cell, "execution_count": number, "outputs": list(_outputs(source(cell), names, number))}
        cells.append(cell)
    return {**notebook, "cells": cells}


def _outputs(text: str, names: dict[str, Any], number: int) -> Iterator[Cell]:
    """Run a cell; give what it prints, the value of its last expression, and figures of pyplot."""
    tree, printed = ast.parse(text), io.StringIO()
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    with redirect_stdout(printed):
        exec(compile(tree, f"<cell {number}>", "exec"), names)
        value = eval(compile(ast.Expression(last.value), f"<cell {number}>", "eval"), names) if last else None
    if printed.getvalue():
        yield {"output_type": "stream", "name": "stdout", "text": printed.getvalue().splitlines(True)}
    if value is not None and not text.rstrip().endswith(";"):
        data = {"text/plain": repr(value).splitlines(True)}
        if hasattr(value, "_repr_html_"):
            data["text/html"] = value._repr_html_().splitlines(True)
        yield {"output_type": "execute_result", "execution_count": number, "data": data, "metadata": {}}
    yield from _figures()


def _figures() -> Iterator[Cell]:
    from matplotlib import pyplot

    for number in pyplot.get_fignums():
        file = io.BytesIO()
        pyplot.figure(number).savefig(file, dpi=DOTS, metadata={"Software": None})
        data = {"image/png": base64.b64encode(file.getvalue()).decode(), "text/plain": ["<Figure>"]}
        yield {"output_type": "display_data", "data": data, "metadata": {}}
    pyplot.close("all")


def page(path: Path) -> str:
    """Write a notebook as the Markdown of a page: cells, and what they show."""
    parts = [source(cell) if cell["cell_type"] == "markdown" else _code(cell) for cell in read(path)["cells"]]
    head, *rest = parts
    return "\n\n".join([head, f"[Download this notebook]({path.name}){{download}}", *rest]) + "\n"


def _code(cell: Cell) -> str:
    shown = [f"```python\n{source(cell).rstrip()}\n```", *map(_shown, cell["outputs"])]
    return "\n\n".join(shown)


def _shown(output: Cell) -> str:
    if output["output_type"] == "stream":
        return f"```text\n{''.join(output['text']).rstrip()}\n```"
    data = output["data"]
    if "text/html" in data:
        text = "".join(data["text/html"]).replace("\n", " ")  # an empty line would end the block
        return f'<div class="output">{text}</div>'
    if "image/png" in data:
        return f'<p><img alt="figure" src="data:image/png;base64,{data["image/png"]}"></p>'
    return f"```text\n{''.join(data['text/plain'])}\n```"


def main() -> int:
    """Execute all notebooks."""
    for path in paths():
        text = json.dumps(executed(read(path)), indent=1, ensure_ascii=False)
        path.write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
