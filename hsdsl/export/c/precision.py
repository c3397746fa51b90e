"""Settings of a run in 32-bit floats: no tolerance below their round-off, and the order that belongs to it."""

from __future__ import annotations

from dataclasses import replace

from hsdsl.base.numbers.arithmetic import FLOAT64, Arithmetic
from hsdsl.engine.simulate import Settings
from hsdsl.engine.simulate.refinement import LEAST_UNITS

FLOAT32 = replace(FLOAT64, name="float32", bits=24, unit=2.0**-24)  # its numbers are rounded where they are compiled


def in_single(settings: Settings) -> Settings:
    """The settings that a program in 32-bit floats has."""
    assert settings.method is not None
    if settings.tolerance is None:
        return replace(settings, method=settings.method.for_tolerance(None, FLOAT32))
    tolerance = max(settings.tolerance, LEAST_UNITS * FLOAT32.unit)
    return replace(settings, tolerance=tolerance, method=settings.method.for_tolerance(tolerance, FLOAT32))


def in_both(single: str, double: str) -> str:
    """Text for both precisions; the same in both is written once."""
    return double if single == double else f"#if defined(HS_FLOAT32)\n{single}#else\n{double}#endif\n"


PRECISIONS: tuple[Arithmetic, ...] = (FLOAT32, FLOAT64)
