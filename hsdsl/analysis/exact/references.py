"""The exact execution of a model: a stored one that solves it, found by content.

Stored executions are the files of ``stored/`` (written by ``models/references/build.py``) and of the folder
``references`` next to the model. The one that starts where the model does and satisfies its flow, guards, resets and
domains is the model's reference; names of files do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from hsdsl.analysis.exact.residual import residual
from hsdsl.analysis.store import load
from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_arguments
from hsdsl.engine.execution import Execution, Point
from hsdsl.mathematics.program import Program

STORED = Path(__file__).with_name("stored")
LARGEST_DEFECT = 1e-9  # of slopes, guards and resets, relative


class Referenced(Protocol):
    """The part of a model that its reference needs."""

    @property
    def program(self) -> Program: ...

    @property
    def system(self) -> Any: ...
    @property
    def simulate(self) -> Callable[..., Execution]: ...


@checks_arguments
def reference(model: Referenced, block: int = 0) -> Execution:
    """Return the exact execution of a model.

    Parameters
    ----------
    model : Model
        A model that a stored execution solves.
    block : int
        Index in the model's ``reference:`` section, where it has several blocks (other initial values).

    Returns
    -------
    Execution
        ``settings["error"]`` bounds its error at any time, ``settings["source"]`` names its origin.

    Raises UsageError: no stored execution solves the model.
    """
    program = model.program
    defects: dict[str, str] = {}
    if 0 <= block < max(1, len(references_of(model))):
        start = model.simulate(until=0, initial=start_of(model, block))(0.0, side="left")
        for run in _candidates(program):
            defect = _defect(program, start, run)
            if not defect:
                return replace(run, model=program.path, digest=program.digest)
            defects[defect] = f"; that of '{run.title}' {defect}"
    nearest = defects[max(defects, key=len)] if defects else ""
    raise UsageError(
        f"no exact execution is known for block {block} of {Path(program.path).name}{nearest}",
        "hsdsl.exact.precise(model, digits) refines a run until so many digits stay",
    )


def references_of(model: Referenced) -> list[Mapping[str, str]]:
    """The overrides of each block of a model's ``reference:`` section, by names such as ``initial.w``."""
    return [block.settings for block in model.system.reference]


def start_of(model: Referenced, block: int) -> Mapping[str, str]:
    """The initial values by which a block of a model's ``reference:`` section differs from the model."""
    settings: Mapping[str, str] = dict(enumerate(references_of(model))).get(block, {})
    if any(not name.startswith("initial.") for name in settings):
        raise UsageError(f"block {block} of the reference overrides more than initial values, which is not supported")
    return {name.removeprefix("initial."): text for name, text in settings.items()}


def _candidates(program: Program) -> Iterator[Execution]:
    """Stored executions whose first mode is a mode of the model, with the same states."""
    modes = {mode.name: mode.states for mode in program.modes}
    for folder in (Path(program.path).parent / "references", STORED):
        for path in sorted(folder.glob("*.npz")):
            try:
                run = load(path)
            except UsageError:  # some other file
                continue
            if run.arcs[0].states == modes.get(run.arcs[0].mode):
                yield run


def _defect(program: Program, start: Point, run: Execution) -> str:
    """Why an execution is not the model's own from a start; empty where it is."""
    first = run(0.0, side="left")
    if first.mode != start.mode:
        return "starts in another mode"
    if any(abs(first.state[name] - value) > LARGEST_DEFECT for name, value in start.state.items()):
        return "starts elsewhere"
    try:
        defect = residual(program, run)
    except ValueError as error:
        return f"does not fit the model: {error}"
    return "" if defect <= LARGEST_DEFECT else f"does not solve the model as it is written: off by {defect:.2g}"
