"""A run as fields of the model's structure: inputs over time, sizes of states, settings."""

from __future__ import annotations

from collections.abc import Iterable

from hsdsl.engine.simulate import Problem
from hsdsl.export.matlab.text import matrix, string, vector


def run_fields(problem: Problem) -> Iterable[tuple[str, str]]:
    """Names of fields with their values.

    ``data`` has a row of numbers for each stretch of inputs. ``typical`` has a size of each state, by which the sets of
    a toolbox know round-off.
    """
    settings, segments = problem.settings, problem.timeline.segments
    yield "starts", _column(s.start for s in segments)
    rows = [s.data[len(problem.program.parameters) :] for s in segments]
    yield "data", matrix(rows) if rows[0] else f"zeros({len(rows)}, 0)"
    scale = {name: float(settings.scale.get(name, 0.0)) for name in problem.program.all_states}
    first = {name: abs(float(number)) for name, number in zip(problem.states, problem.x, strict=True)}
    yield "typical", _column(max(size, first.get(name, 0.0)) for name, size in scale.items())
    yield "settings.scheme", string(settings.scheme)
    numbers = {"step": settings.step or 0.0, "tolerance": settings.tolerance or 0.0, "relaxation": settings.relaxation}
    numbers |= {"until": settings.until, "max_transitions": settings.max_transitions}
    yield from ((f"settings.{key}", vector([number])) for key, number in numbers.items())


def _column(values: Iterable[float]) -> str:
    numbers = list(values)
    return vector(numbers, "; ") if numbers else "zeros(0, 1)"
