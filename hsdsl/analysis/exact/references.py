"""The exact execution of a model: a stored one that solves it, found by content.

Stored executions are the files of ``stored/`` (written by ``models/references/build.py``) and of the folder
``references`` next to the model. The one that starts where the model does and satisfies its flow, guards, resets and
domains, by its `residual`, is the model's reference; names of files do not count.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hsdsl.analysis.store import load
from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_arguments
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64
from hsdsl.engine.backends.python import PythonKernel
from hsdsl.engine.execution import Arc, Array, Execution, Point, Transition
from hsdsl.engine.kernel import ModeKernel, Routine
from hsdsl.mathematics.program import ModeProgram, Program

STORED = Path(__file__).with_name("stored")
LARGEST_DEFECT = 1e-9  # of slopes, guards and resets, relative


@checks_arguments
def reference(model: Any, block: int = 0) -> Execution:
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


def references_of(model: Any) -> list[Mapping[str, str]]:
    """The overrides of each block of a model's ``reference:`` section, by names such as ``initial.w``."""
    return [block.settings for block in model.system.reference]


def start_of(model: Any, block: int) -> Mapping[str, str]:
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


SHARES = (0.0, 0.3, 0.9)  # of a piece, at which it is compared
SHORTEST = 1e-9  # pieces shorter than this have no slope in floats


def residual(program: Program, run: Execution) -> float:
    """Return the largest relative defect of an execution at its model's parameters; 0 is a solution.

    Compared are slopes with the flow within each piece, guards and resets at each transition, and rows with the domain.
    A defect counts relative to 1 plus the size of the compared values. A slope's defect counts beyond its round-off and
    the effect of the state's round-off on a stiff flow. A state at rest must lie on a guard.

    Raises ValueError: the model has no such mode, states or transition, or has inputs that jump or bend.
    """
    if program.inputs or program.switches:
        raise ValueError("models with inputs that jump or bend are not compared")
    check = _Check(program)
    flows = max((check.flow(run, arc) for arc in run.arcs if arc.kind == "flow"), default=0.0)
    return max(flows, *(check.jump(t) for t in run.transitions), 0.0)


class _Check:
    """A model's routines at its own parameters."""

    def __init__(self, program: Program) -> None:
        kernel, parameters = PythonKernel(program, FLOAT64), ()
        for k in range(len(program.parameters)):
            parameters = (*parameters, *kernel.constant(f"parameter_{k}", parameters))
        self.modes = {mode.name: (mode, kernel.bind(k, parameters)) for k, mode in enumerate(program.modes)}
        self._jacobians = {mode.name: kernel.jacobian(k, parameters) for k, mode in enumerate(program.modes)}

    def mode(self, name: str, states: tuple[str, ...]) -> tuple[ModeProgram, ModeKernel]:
        if name not in self.modes or (self.modes[name][0].states != states and not self.modes[name][0].final):
            raise ValueError(f"no mode {name} with the states {', '.join(states)}")
        return self.modes[name]

    def flow(self, run: Execution, arc: Arc) -> float:
        """Slopes within an arc against its flow; its rows against the domain."""
        program, kernel = self.mode(arc.mode, arc.states)
        if program.final:
            return 0.0
        walls = program.surfaces[len(program.edges) :]
        bounds = [k for k, edge in enumerate(program.edges) if not edge.conditional] + [*walls]
        worst, width = 0.0, len(arc.states)
        for k in range(arc.first, arc.last + 1):
            x = tuple(run.values[k, :width].tolist())
            beyond = [kernel.surfaces(float(run.times[k]), *x)[i] for i in bounds]
            worst = max([worst, *(r / (1 + float(np.max(np.abs(x)))) for r in beyond)])
        for k in range(arc.first, arc.last):
            worst = max(worst, self._piece(run, k, width, kernel, self._jacobians[arc.mode]))
        return worst

    def _piece(self, run: Execution, k: int, width: int, kernel: ModeKernel, jacobian: Routine) -> float:
        h = float(run.times[k + 1] - run.times[k])
        if h < SHORTEST:
            return 0.0
        worst = 0.0
        for share in SHARES:
            t, x, slope = _at(run, k, share, width)
            flow = np.array(kernel.flow(t, *x))
            if not np.any(slope) and np.any(flow):  # at rest: on a guard
                worst = max(worst, float(np.min(np.abs(kernel.surfaces(t, *x)))))
                continue
            off = 2.0**-46 * (1 + float(np.max(np.abs(x))))  # of the state
            noise = off / h + off * _steepness(jacobian, t, x) + 2.0**-52 * t / h * np.abs(slope / h)
            worst = max(worst, float(np.max(np.maximum(np.abs(slope / h - flow) - noise, 0) / (1 + np.abs(flow)))))
        return worst

    def jump(self, t: Transition) -> float:
        """Guard and reset of a transition, and that the flow leads out."""
        program, kernel = self.mode(t.source, tuple(t.before))
        k = next((k for k, edge in enumerate(program.edges) if edge.name == t.edge), None)
        if k is None:
            raise ValueError(f"no transition {t.edge}")
        before, after = tuple(t.before.values()), np.array(list((t.after or {}).values()))
        if kernel.rates[k](t.time, *before)[0] <= 0:
            return float("inf")
        reset = np.array(kernel.resets[k](t.time, *before))
        if len(reset) != len(after):
            raise ValueError(f"{t.edge} leads to other states")
        size = 1 + float(np.max(np.abs(before)))
        return max(
            abs(kernel.surfaces(t.time, *before)[k]) / size, float(np.max(np.abs(reset - after), initial=0)) / size
        )


def _steepness(jacobian: Routine, t: float, x: Array) -> Array:
    """How much each slope changes with the state, at most; 0 where that is not known."""
    try:
        rows = np.abs(np.array(jacobian(t, *x), float)).reshape(len(x), len(x))
    except DOMAIN_ERRORS:
        return np.zeros(len(x))
    return np.where(np.isfinite(rows), rows, 0).sum(axis=1)


def _at(run: Execution, k: int, share: float, width: int) -> tuple[float, Array, Any]:
    """Time, state and derivative by the share, a share into the piece after row k."""
    t = float(run.times[k] + share * (run.times[k + 1] - run.times[k]))
    start = run.values[k, :width]
    if run.coefficients.shape[1] == 0:
        rise = run.values[k + 1, :width] - start
        return t, start + share * rise, rise
    powers: Array = np.arange(1.0, run.coefficients.shape[1] + 1).reshape(-1, 1)
    piece = run.coefficients[k, :, :width]
    return t, start + (piece * share**powers).sum(axis=0), (powers * piece * share ** (powers - 1)).sum(axis=0)
