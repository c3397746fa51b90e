"""A method as data for the driver: a Butcher tableau, or the collocation of Radau IIA."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

from hsdsl.arithmetic import FLOAT64
from hsdsl.export.matlab.text import matrix, string, vector
from hsdsl.integrators import INTEGRATORS, ButcherTableau, Method
from hsdsl.simulate import Settings

INSTEAD_OF_TAYLOR = "dopri5"  # the driver has no Taylor series; its steps suit the cubic pieces that it looks along


def driven_by(method: Method) -> Method:
    """The method that the driver uses for one of a run."""
    return INTEGRATORS[INSTEAD_OF_TAYLOR] if method.is_series else method


def method_text(settings: Settings) -> Iterable[tuple[str, str]]:
    """The fields of ``m.method`` with their values."""
    assert settings.method is not None
    method = driven_by(settings.method)
    yield "name", string(method.name)
    yield "implicit", "true" if method.implicit else "false"
    yield "error_order", vector([method.error_order])
    if method.implicit:
        yield from _collocation()
    else:
        assert isinstance(method, ButcherTableau)
        yield from _tableau(method)


def _collocation() -> Iterable[tuple[str, str]]:
    from hsdsl.integrators.collocation import coefficients

    known = coefficients(FLOAT64)
    yield "interpolant", string("dense")
    yield "c", vector(known.nodes, "; ")
    yield "a", matrix(known.a)
    yield "dense", matrix(tuple(zip(*known.powers, strict=True)))
    yield "gamma", vector([known.gamma])
    yield "estimate", vector(known.estimate, "; ")


def _tableau(table: ButcherTableau) -> Iterable[tuple[str, str]]:
    """Stages first, then the slope at the step's end, then the stages of the dense output alone."""
    stages = table.stages - table.last_is_next
    columns = stages + 1 + len(table.extra)
    rows = [*table.a[:stages], (), *table.extra]
    yield "interpolant", string(table.interpolant)
    yield "stages", vector([stages])
    yield "extra", vector([len(table.extra)])
    yield "c", vector((_number(sum(row, Fraction(0))) for row in rows), "; ")
    yield "a", matrix([_padded(row, columns) for row in rows])
    yield "b", vector(map(_number, table.b[:stages]), "; ")
    yield "error", _difference(table.b, table.embedded, stages + 1)
    yield "coarse", _difference(table.b, table.coarse, stages + 1)
    dense = table.dense or ()
    yield (
        "dense",
        matrix([_padded(row, table.degree) for row in [*dense, *[()] * (columns - len(dense))]]) if dense else "[]",
    )


def _difference(b: Sequence[Fraction], other: Sequence[Fraction] | None, length: int) -> str:
    if other is None:
        return "[]"
    return vector(_padded([v - w for v, w in zip(b, other, strict=True)], length), "; ")


def _padded(row: Sequence[Fraction], length: int) -> list[float]:
    return [*map(_number, row), *[0.0] * (length - len(row))]


def _number(value: Fraction) -> float:
    return FLOAT64.constant(value)
