"""A model as one Python module that needs JAX and numpy: routines generated, simulators from a template.

Its simulators compile, vectorise and differentiate, in forward and reverse mode, over parameters and initial states.
"""

from __future__ import annotations

import sys

from hsdsl.export.explicit import explicit
from hsdsl.export.identifiers import identifiers
from hsdsl.export.jax.model import model_text
from hsdsl.export.jax.template_text import template_text
from hsdsl.export.source import Source

RESERVED = {*sys.stdlib_module_names, "jax", "jaxlib", "numpy", "scipy", "ml_dtypes", "opt_einsum"}


def files(source: Source) -> dict[str, bytes]:
    """One module.

    Raises UsageError: a scheme or method that it cannot keep.
    """
    source, table = explicit(source, "jax")
    imports, template = template_text()
    comments = "".join(f"# {line}\n" for line in source.heading)
    parts = (comments, DOCUMENTATION, imports, template, model_text(source, table))
    name = identifiers([source.name], RESERVED)[source.name]
    return {f"{name}.py": "\n".join(parts).encode()}


DOCUMENTATION = '''"""A hybrid system for JAX: `simulate` runs it from `parameters()` and an `initial` state.

    run = jax.jit(lambda p: simulate(p))(parameters({"NAME": 1.5}))
    runs = jax.vmap(lambda x0: simulate(x0=x0))(states)
    slopes = jax.jacfwd(lambda p: simulate(p).x)(parameters())
    gradient = jax.grad(lambda p: simulate(p, rounds=1000).x[0])(parameters())

Numbers have 64 bits: importing this module says so to JAX. A derivative goes through the times of transitions; the time
that a state waits in a strip of the relaxed scheme is constant, as in the limit. Derivatives are of first order.
"""
'''
