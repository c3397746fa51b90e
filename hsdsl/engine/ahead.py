"""A model that is elaborated and lowered in another process, while this one loads what compiles, runs and reports it.

The other process is a copy of this one from before anything large was loaded. It answers with the program or with the
errors of the model; where it ends without an answer, this process does the work itself. Large models are lowered in
two processes.
"""

from __future__ import annotations

import atexit
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TypeVar

from hsdsl.base import interrupts
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.base.limits import applied, cores, current
from hsdsl.language.files import ModelFiles
from hsdsl.mathematics import program_cache
from hsdsl.mathematics.program import Program

First = TypeVar("First")
Second = TypeVar("Second")
Result = TypeVar("Result")


class Lowered(NamedTuple):
    """The program of a model, the one with modes of sliding where it has them, and all bytes they were made from."""

    program: Program
    sliding: Program | None
    files: ModelFiles


Answer = Lowered | ModelError | None
LARGE = 0.03  # seconds to elaborate a model, from which on a copy takes less time than half of the lowering


_begun: list[tuple[ModelFiles, int, int]] = []  # files, the process that lowers them, and where its answer is read


def _answer_of(answer: int) -> Any:
    """The answer of another process; None where it ends without one."""
    import pickle  # what was compiled before needs none

    with open(answer, "rb", closefd=False) as stream:
        written = stream.read()
    with suppress(EOFError, pickle.UnpicklingError):
        return pickle.loads(written)
    return None


def _end(process: int, answer: int) -> None:
    """End a process, if it has not ended; until it is waited for, its number is no other's."""
    from signal import SIGKILL

    os.close(answer)
    with suppress(ProcessLookupError):
        os.kill(process, SIGKILL)
    with suppress(ChildProcessError):
        os.waitpid(process, 0)


def begin(files: ModelFiles) -> None:
    """Begin to lower a model in another process, where that saves time: see :func:`taken`."""
    if _saves_time() and not program_cache.is_kept(files):
        with suppress(OSError):  # there may be no more processes
            _begun.append((files, *_copy(lambda: _lowered(files))))


def begin_run(words: list[str]) -> None:
    """Start a run without options before the modules that parse command lines are loaded."""
    match words:
        case ["run", model, *options] if set(options) <= {"--json", "--quiet", "-q"} and os.path.isfile(model):
            with suppress(UsageError):  # which the command reports
                begin(ModelFiles.read(Path(model)))
        case _:
            pass


def _saves_time() -> bool:
    """Whether this process has one thread, nothing large is loaded, and there are two processors or more."""
    return (
        sys.platform == "linux"  # elsewhere a copy may not use the libraries of the system, or there is none
        and cores() > 1
        and not sys.modules.keys() & {"numpy", "sympy"}
        and len(os.listdir("/proc/self/task")) == 1
    )


def taken(files: ModelFiles, needed: Sequence[str] = ()) -> Lowered | None:
    """The programs of a model that was begun; None if there are none.

    Modules that are needed afterwards are imported while the other process works.

    Raises ModelError: the model has errors.
    """
    for one in [each for each in _begun if each[0] == files]:
        for name in needed:
            import_module(name)
        answer: Answer = _answer_of(one[2])
        _begun.remove(one)
        _end(*one[1:])
        if isinstance(answer, ModelError):
            raise answer
        return answer
    return None


def _copy(work: Callable[[], object]) -> tuple[int, int]:
    """Begin some work in a copy of this process: its number, and where its answer is read.

    Raises OSError: there may be no more processes.
    """
    answer, to_answer = os.pipe()
    try:
        process = os.fork()
    except OSError:
        os.close(answer)
        raise
    else:
        if process == 0:
            os.close(answer)  # else a large answer is waited with for ever where the reader has ended
            _work(work, to_answer)
        return process, answer
    finally:
        os.close(to_answer)


def _work(work: Callable[[], object], to_answer: int) -> NoReturn:
    """Answer, and end this process without what its copy does at its end."""
    import ctypes
    import pickle
    import signal

    try:
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: nobody reads what it answers then
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # the other one says that it was interrupted
        content = pickle.dumps(work())
        with open(to_answer, "wb") as stream:
            stream.write(content)
    finally:
        os._exit(0)


def _both(first: Callable[[], First], second: Callable[[], Second]) -> tuple[First, Second]:
    """Do two things at once, the second in a copy of this process, and here where that gives no answer."""
    try:
        other = _copy(lambda: _in_time(second))
    except OSError:  # there may be no more processes
        return first(), second()
    try:
        done, answer = first(), _answer_of(other[1])
    finally:
        _end(*other)
    return done, second() if answer is None else answer


def _in_time(work: Callable[[], Result]) -> Result:
    """Do some work within the limits in force, which are watched in each process."""
    from hsdsl.language.expression.timebox import timebox

    with timebox(current().seconds):
        return work()


def _lowered(files: ModelFiles) -> Answer:
    import gc
    import time

    gc.disable()  # imports leave no garbage; to look for it costs time
    from hsdsl.language.elaborate import elaborate_files
    from hsdsl.mathematics.completion import with_sliding
    from hsdsl.mathematics.lower import in_turn, lower

    gc.freeze()
    gc.enable()
    try:
        began = time.process_time()
        system = elaborate_files(files).system
        both = _both if time.process_time() - began > LARGE else in_turn
        with applied(files.limits):
            program = sliding = lower(system, both)
            if system.experiment.completion != "auto":
                sliding = None
            elif (slides := with_sliding(system)) is not system:
                sliding = lower(slides, both)
            return Lowered(program, sliding, files.with_data(system.files))
    except ModelError as error:
        return error


@atexit.register
def _end_all() -> None:
    while _begun:
        _end(*_begun.pop()[1:])


interrupts.before_leaving.append(_end_all)
