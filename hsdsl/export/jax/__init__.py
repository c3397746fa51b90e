"""A model as one Python module that needs JAX and numpy: routines generated, simulators from a template.

Its simulators compile, vectorise and differentiate, in forward and reverse mode, over parameters and initial states.
"""

from __future__ import annotations

import ast
import sys
from functools import cache
from pathlib import Path

from hsdsl.base.errors import Diagnostic, ModelError
from hsdsl.export.automata import document_of
from hsdsl.export.jax.model import model_text
from hsdsl.export.jax.template import PARTS
from hsdsl.export.source import Source, explicit, filled, identifiers
from hsdsl.mathematics.program import ModeProgram, Queue

TEMPLATE = Path(__file__).parent / "template"


@cache
def template_text() -> tuple[str, str]:
    """The import statements and the text below them."""
    imports: dict[str, None] = {}
    bodies: list[str] = []
    for part in PARTS:
        text = (TEMPLATE / f"{part}.py").read_text(encoding="utf-8")
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


RESERVED = {*sys.stdlib_module_names, "jax", "jaxlib", "numpy", "scipy", "ml_dtypes", "opt_einsum"}


def files(source: Source) -> dict[str, bytes]:
    """One module.

    Raises UsageError: a scheme or method that it cannot keep. Raises ModelError: a rule that it lacks.
    """
    check(source)
    source, table = explicit(source, "jax")
    imports, template = template_text()
    head = (TEMPLATE / "head.in").read_text(encoding="utf-8")
    head = filled(head, heading="".join(f"# {line}\n" for line in source.heading))
    parts = (head, imports, template, model_text(source, table))
    name = identifiers([source.name], RESERVED)[source.name]
    return {f"{name}.py": "\n".join(parts).encode()}


LACKING = "HS341"


def check(source: Source) -> None:
    """Refuse events of which several executions may wait: what waits are states here, and there are those of one.

    Raises ModelError: the first such event.
    """
    for mode in source.problem.program.modes:
        for queue in mode.queues:
            if queue.most > 1:
                raise ModelError([_refused(source, mode, queue)])


def _refused(source: Source, mode: ModeProgram, queue: Queue) -> Diagnostic:
    name = queue.name.rpartition("@")[0]
    message = f"jax keeps one execution of '{name}' that waits: expected `waiting: 1`, got {queue.most}"
    hint = "with `waiting: 1` a second one ends a run, with `waiting_limit`; other targets keep several"
    if source.model.pipeline.files is None:
        return Diagnostic(LACKING, message, None, hint)
    written = next(m for key, m in document_of(source).modes.items() if str(key) == mode.name)
    places = [t.delay.place for t in written.transitions if t.delay is not None and t.waiting == queue.most]
    named = [t.delay.place for t in written.transitions if t.delay and t.name and t.name.value == name]
    return (named or places)[0].diagnostic(LACKING, message, hint)
