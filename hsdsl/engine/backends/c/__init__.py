"""C99 from a program: `source` writes the whole text, `routine` one routine of it, `series` its Taylor coefficients."""

from hsdsl.engine.backends.c.source import (
    constant_bodies,
    derivatives,
    factors,
    initial_bodies,
    lines,
    model_parts,
    model_source,
    routine_functions,
    switching_bodies,
    width,
)

__all__ = [
    "constant_bodies", "derivatives", "factors", "initial_bodies", "lines", "model_parts", "model_source",
    "routine_functions", "switching_bodies", "width",
]  # fmt: skip
