"""The exact execution of a model: a closed form where there is one, else what is stored beside the model.

Stored executions lie in ``references/NAME-K.npz`` in the folder of ``NAME.yaml``, K counting the blocks of its
``reference:`` section from 0. Whichever it is, it is held against the model as it reads now before it is given out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from hsdsl.errors import UsageError
from hsdsl.exact.ball import bouncing_ball
from hsdsl.exact.heater import thermostat
from hsdsl.exact.oscillators import oscillator
from hsdsl.exact.pendulum import constrained_pendulum
from hsdsl.exact.quadrants import digital_control
from hsdsl.exact.residual import residual
from hsdsl.exact.runner import pronking_runner
from hsdsl.exact.stiff_switch import stiff_switch
from hsdsl.execution import Execution
from hsdsl.program import Program
from hsdsl.store import load

Solution = Callable[[], Execution]

CLOSED_FORMS: dict[str, tuple[Solution, ...]] = {
    "bouncing-ball": (bouncing_ball,),
    "digital-control": (
        digital_control,
        lambda: digital_control("-1.1", -1),
        lambda: digital_control(-1, "-1.1"),
    ),
    "oscillator-with-stop-1": (lambda: oscillator(1),),
    "oscillator-with-stop-2": (lambda: oscillator(2),),
    "stiff-switch": (stiff_switch,),
    "thermostat": (thermostat,),
}
"""By a model's name, for each block of its ``reference:``: solved by formula, when asked for."""

STORED: dict[str, tuple[Solution, ...]] = {
    "constrained-pendulum": (constrained_pendulum,),
    "pronking-runner": (pronking_runner, lambda: pronking_runner("-0.4")),
}
"""The same, solved by series, which takes seconds: ``python models/references/build.py`` writes them down."""

LARGEST_DEFECT = 1e-9  # of slopes, guards and resets, relative


class Referenced(Protocol):
    """A model, as far as its reference needs one."""

    @property
    def program(self) -> Program: ...

    @property
    def system(self) -> Any: ...
    @property
    def simulate(self) -> Callable[..., Execution]: ...


def reference(model: Referenced, block: int = 0) -> Execution:
    """Return the exact execution that belongs to a model.

    Parameters
    ----------
    model : Model
        One with a closed form in `CLOSED_FORMS`, or with an execution stored beside it.
    block : int
        Which block of its ``reference:``, where it has several (other initial values).

    Returns
    -------
    Execution
        ``settings["error"]`` says what it is off by at most at any time, ``settings["source"]`` where it comes from.

    Raises
    ------
    UsageError
        Nothing exact is known of the model, or what is known does not solve it (it was edited since).
    """
    path = Path(model.program.path)
    known, stored = CLOSED_FORMS.get(path.stem, ()), path.parent / "references" / file_name(path.stem, block)
    if 0 <= block < len(known):
        found = known[block]()
    elif block >= 0 and stored.is_file():
        found = load(stored)
    else:
        raise UsageError(
            f"no exact execution is known for block {block} of {path.name}, and {stored} is not there",
            "hsdsl.exact.precise(model, digits) refines a run until so many digits stay",
        )
    _check(model, block, found)
    return replace(found, model=model.program.path, digest=model.program.digest)


def references_of(model: Referenced) -> list[Mapping[str, str]]:
    """What each block of a model's ``reference:`` sets, by names such as ``initial.w``."""
    return [block.get("set", {}) for block in model.system.reference]


def file_name(stem: str, block: int) -> str:
    """The name of a stored reference."""
    return f"{stem}-{block}.npz"


def _check(model: Referenced, block: int, found: Execution) -> None:
    """Refuse an execution that does not begin where the block says, or does not follow the model's equations."""
    what = f"the exact execution known as {Path(model.program.path).stem}, block {block},"
    settings: Mapping[str, str] = references_of(model)[block] if block < len(references_of(model)) else {}
    if any(not name.startswith("initial.") for name in settings):
        raise UsageError(f"{what} is of other parameters or settings than the model's own, which is not supported")
    initial = {name.removeprefix("initial."): text for name, text in settings.items()}
    start = model.simulate(until=0, initial=initial)(0.0, side="left")
    first = found(0.0, side="left")
    if first.mode != start.mode or set(first.state) != set(start.state):
        raise UsageError(f"{what} starts in another mode than the model")
    if any(abs(first.state[name] - value) > LARGEST_DEFECT for name, value in start.state.items()):
        raise UsageError(f"{what} starts elsewhere than the model")
    try:
        defect = residual(model.program, found)
    except ValueError as error:
        raise UsageError(f"{what} does not fit the model: {error}") from None
    if not defect <= LARGEST_DEFECT:
        raise UsageError(f"{what} does not solve the model as it is written: off by {defect:.2g}")
