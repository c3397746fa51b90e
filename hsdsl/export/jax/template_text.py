"""The template's modules as one text: imports of each other left out, those of libraries gathered at the top."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from hsdsl.export.jax.template import PARTS


@cache
def template_text() -> tuple[str, str]:
    """The import statements and the text below them."""
    imports: dict[str, None] = {}
    bodies: list[str] = []
    for part in PARTS:
        text = (Path(__file__).parent / "template" / f"{part}.py").read_text(encoding="utf-8")
        nodes = [node for node in ast.parse(text).body if isinstance(node, ast.Import | ast.ImportFrom)]
        for node in nodes:
            if not isinstance(node, ast.ImportFrom) or not node.level:
                imports[ast.unparse(node)] = None
        rest = "\n".join(text.splitlines()[max(node.end_lineno or 0 for node in nodes) :])
        docstring = ast.get_docstring(ast.parse(text)) or ""
        heading = "".join(f"# {line}\n" if line else "#\n" for line in docstring.splitlines())
        bodies.append(f"{'# ' + '-' * 70}\n{heading}{'# ' + '-' * 70}\n\n{rest.strip()}\n")
    first = sorted(imports, key=lambda line: ("__future__" not in line, line.startswith("from"), line))
    return "\n".join(first) + "\n", "\n\n".join(bodies)
