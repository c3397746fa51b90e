"""Orbital stability of a model's execution: runs from nearby and their distances."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.orbits.sampling import OrbitalStability, directions, sampled
from hsdsl.base.errors import UsageError
from hsdsl.base.names import called
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.execution import Execution
from hsdsl.engine.preparation.options import check_arguments, overrides_of
from hsdsl.engine.preparation.values import whole, with_parameters
from hsdsl.interface.model.differentiate import located_arguments, start_by, varied
from hsdsl.interface.model.distances import distance_of_runs

if TYPE_CHECKING:
    from hsdsl.interface.model.model import Model

REFUSED = ("step", "scheme", "samples", "precision")


def orbital_stability(
    model: Model,
    wrt: str | Sequence[str] | None,
    radii: Sequence[float],
    samples: int,
    seed: int,
    progress: Callable[[int, int], None] | None,
    arguments: Mapping[str, Any],
) -> OrbitalStability:
    """Test an execution; see `Model.orbital_stability`."""
    check_arguments(arguments, "a stability test", REFUSED)
    if len(radii) < 2 or not all(0 < b < a for a, b in pairwise(radii)):
        raise UsageError(f"expected at least two radii that fall, got {', '.join(map(str, radii))}")
    call = located_arguments(model.pipeline, arguments)
    values = with_parameters(model.pipeline.values(FLOAT64), overrides_of(call, "parameters", model.program))
    by, known = start_by(wrt, call, values)
    run = model.simulate(**call)
    sizes = run.sizes()
    scales = np.array([abs(known[t.label]) or sizes.get(t.name, 0.0) or 1.0 for t in by])
    ways = directions(len(by), whole(samples, "samples", 1), seed)
    total, done = len(radii) * len(ways), 0

    def look(shift: Mapping[str, float]) -> tuple[float, float, tuple[str, ...]]:
        nonlocal done
        moved = {label: number + shift[label] for label, number in known.items()}
        other = model.simulate(**varied(call, by, moved, model.program))
        found = _distance(run, other, model)
        done += 1
        if progress is not None:
            progress(done, total)
        return (*found, tuple(made.edge for made in other.transitions))

    title = called(run.title, run.model)
    return sampled([t.label for t in by], scales, list(radii), ways, look, title)


def _distance(run: Execution, other: Execution, model: Model) -> tuple[float, float]:
    """How far apart two runs are; one that stops for another reason is nowhere near."""
    if run.stop.reason != other.stop.reason:
        return inf, inf
    found = distance_of_runs(run, other, model=model).interval
    return float(found.lower), float(found.upper)
