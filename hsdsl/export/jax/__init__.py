"""A model as one Python module that needs JAX and numpy: routines generated, simulators from a template.

Its simulators compile, vectorise and differentiate, in forward and reverse mode, over parameters and initial states.
"""

from __future__ import annotations

import ast
import sys
from functools import cache
from pathlib import Path

from hsdsl.export.jax.model import model_text
from hsdsl.export.jax.refusals import check
from hsdsl.export.jax.template import PARTS
from hsdsl.export.source import Source, explicit, identifiers


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


RESERVED = {*sys.stdlib_module_names, "jax", "jaxlib", "numpy", "scipy", "ml_dtypes", "opt_einsum"}


def files(source: Source) -> dict[str, bytes]:
    """One module.

    Raises UsageError: a scheme or method that it cannot keep. Raises ModelError: a rule that it lacks.
    """
    check(source)
    source, table = explicit(source, "jax")
    imports, template = template_text()
    comments = LACKS + "".join(f"# {line}\n" for line in source.heading)
    parts = (comments, DOCUMENTATION, imports, template, model_text(source, table))
    name = identifiers([source.name], RESERVED)[source.name]
    return {f"{name}.py": "\n".join(parts).encode()}


LACKS = """\
# This loop differentiates and vectorises. Of the rules of docs/meaning.md it lacks these:
# - M13: one execution of an event waits at a time. A model that may need more is refused, and so are systems of parts.
# - M8: an event with a strict comparison goes at the end of a run, too.
# - The located scheme, 2 and 3: a step is looked at in nine points, its ends and seven between. Of two crossings of a
#   surface within an eighth of a step both may be missed, and nothing says so: compare with a shorter step.
# - The located scheme, 4: a guard beyond which the flow has no value fires where no step is short enough.
# - The located scheme, tails: edges that take turns, as the two feet of a rocking block do, are not taken to their
#   limit. Such a run goes on until flights are no longer than round-off (`zeno`), or ends with `transition_limit`.
# - The step: the pace of a run is not looked at. One that creeps ends with `steps`, after ten million rounds, as may
#   one that goes to and fro where the flow jumps.
# - M5: a chain of entries is held against its last sixteen states. One that returns later ends with `transition_limit`.
# - M6 and the verdict: there are no `alternatives`, no warnings and no verdict.
"""
DOCUMENTATION = '''"""A hybrid system for JAX: `simulate` runs it from `parameters()` and an `initial` state.

    run = jax.jit(lambda p: simulate(p))(parameters({"NAME": 1.5}))
    runs = jax.vmap(lambda x0: simulate(x0=x0))(states)
    slopes = jax.jacfwd(lambda p: simulate(p).x)(parameters())
    gradient = jax.grad(lambda p: simulate(p, rounds=1000).x[0])(parameters())

Numbers have 64 bits: importing this module says so to JAX. A derivative goes through the times of transitions; the time
that a state waits in a strip of the relaxed scheme is constant, as in the limit. Derivatives are of first order.
"""
'''
