"""Inputs over time in an exported module: segments at the times of the export, samples that follow parameters."""

from __future__ import annotations

import ast
from bisect import bisect_right

from hsdsl.export.jax.language import function, literal
from hsdsl.export.source import Source, definitions, parameters_in
from hsdsl.mathematics.program import Program

SWITCHES = "it decides when a function of time switches"
SAMPLES = "it decides when an input has a sample"


def fixed_parameters(program: Program) -> dict[str, str]:
    """Parameters that times of segments depend on, and why they cannot change; those that decide them, too."""
    routines = definitions(program.constants)
    found = {i: SWITCHES for i in parameters_in(*definitions(program.switching).values())}
    for i, given in enumerate(program.inputs):
        if given.times is None:
            last = routines[f"input_{i}"].body[-1]
            assert isinstance(last, ast.Return) and isinstance(last.value, ast.Tuple)
            values = last.value.elts
            times = ast.Module([*routines[f"input_{i}"].body[:-1]], [])
            named = parameters_in(times, *values[: len(values) // 2])
            found |= {k: SAMPLES for k in named if k not in found}
    for i in range(len(program.parameters) - 1, -1, -1):
        if i in found:
            found |= {k: found[i] for k in parameters_in(routines[f"parameter_{i}"]) if k not in found}
    return {program.parameters[i]: why for i, why in sorted(found.items())}


def timeline_text(source: Source) -> str:
    """A function ``timeline(p)``: starts, ends and jumps of segments, and the numbers that routines are bound to."""
    program, segments = source.problem.program, source.problem.timeline.segments
    count, inputs = len(program.parameters), len(program.inputs)
    rows = [_row([literal(float(v)) for v in segment.data[count:]]) for segment in segments]
    lines = [
        f"STARTS = np.array({_row([literal(float(s.start)) for s in segments])})",
        f"ENDS = np.array({_row([literal(float(s.end)) for s in segments])})",
        f"JUMPS = np.array({_row([str(s.jump) for s in segments])})",
        f"DATA = np.array([{', '.join(rows)}]).reshape({len(segments)}, {3 * inputs + len(program.switches)})",
        "",
        "",
    ]
    body = ["def timeline(p):", "    data = jnp.asarray(DATA)"]
    data = {f"p{i}": f"p[{i}]" for i in range(count)}
    for i, given in enumerate(program.inputs):
        if given.times is None:
            lines += [function(f"input_{i}", definitions(program.constants)[f"input_{i}"], data, "p"), ""]
            body += _samples(source, i)
    return "\n".join([*lines, *body, "    return jnp.asarray(STARTS), jnp.asarray(ENDS), jnp.asarray(JUMPS), data", ""])


def _samples(source: Source, i: int) -> list[str]:
    """Lines that put an input's samples, which follow parameters, in the columns of its segments' numbers."""
    problem = source.problem
    given = problem.program.inputs[i]
    numbers = problem.kernel.constant(
        f"input_{i}", problem.timeline.segments[0].data[: len(problem.program.parameters)]
    )
    times = numbers[: len(numbers) // 2]
    spots = [bisect_right(times, segment.start) - 1 for segment in problem.timeline.segments]
    last = len(times) - 1
    first = tuple(max(0, k) for k in spots)
    following = tuple(k + 1 if given.hold == "linear" and 0 <= k < last else max(0, k) for k in spots)
    return [
        f"    samples = padded(input_{i}(p), {len(numbers)})",
        f"    times, values = samples[:{len(times)}], samples[{len(times)}:]",
        f"    first, following = np.array({first}), np.array({following})",
        "    length = times[following] - times[first]",
        "    slope = (values[following] - values[first]) / jnp.where(length == 0, 1.0, length)",
        f"    data = data.at[:, {3 * i}:{3 * i + 3}].set(jnp.stack([values[first], slope, times[first]], axis=1))",
    ]


def _row(items: list[str]) -> str:
    return f"[{', '.join(items)}]"
