"""A model that is elaborated and lowered in another process, while this one loads what runs it.

The other process is a copy of this one from before anything large was loaded. It answers with the program or with the
errors of the model; where it ends without an answer, this process does the work itself.
"""

from __future__ import annotations

import atexit
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import NoReturn

from hsdsl import interrupts, program_cache
from hsdsl.errors import ModelError, UsageError
from hsdsl.files import ModelFiles
from hsdsl.limits import applied, cores
from hsdsl.program import Program

Lowered = tuple[Program, Program | None, ModelFiles]  # as it is, with modes of sliding where it has them, its bytes
Answer = Lowered | ModelError | None


@dataclass(frozen=True)
class _Other:
    """The process that lowers a model, and where its answer is read."""

    files: ModelFiles
    process: int
    answer: int

    def wait(self) -> Answer:
        import pickle  # what was compiled before needs none

        with open(self.answer, "rb", closefd=False) as stream:
            written = stream.read()
        with suppress(EOFError, pickle.UnpicklingError):
            return pickle.loads(written)
        return None

    def end(self) -> None:
        """End the process, if it has not ended; until it is waited for, its number is no other's."""
        from signal import SIGKILL

        os.close(self.answer)
        with suppress(ProcessLookupError):
            os.kill(self.process, SIGKILL)
        with suppress(ChildProcessError):
            os.waitpid(self.process, 0)


_begun: list[_Other] = []
_seen: list[ModelFiles] = []


def begin(files: ModelFiles) -> None:
    """Begin to lower a model in another process, where that saves time: see :func:`taken`."""
    if files in _seen:
        return
    _seen.append(files)
    if not _saves_time() or program_cache.is_kept(files):
        return
    answer, to_answer = os.pipe()
    try:
        process = os.fork()
    except OSError:  # there may be no more processes
        os.close(answer)
    else:
        if process == 0:
            os.close(answer)  # else a large answer is waited with for ever where the reader has ended
            _work(files, to_answer)
        _begun.append(_Other(files, process, answer))
    os.close(to_answer)


def begin_run(words: list[str]) -> None:
    """Begin with the model of a command line that runs it as it is, before what reads other command lines is loaded."""
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
    """The programs of a model that was begun, and all bytes that they were made from; None where there is none.

    Modules that are needed afterwards are imported while the other process works.

    Raises ModelError: the model has errors.
    """
    for other in [other for other in _begun if other.files == files]:
        for name in needed:
            import_module(name)
        answer = other.wait()
        _begun.remove(other)
        other.end()
        if isinstance(answer, ModelError):
            raise answer
        return answer
    return None


def _work(files: ModelFiles, to_answer: int) -> NoReturn:
    """Answer, and end this process without what its copy does at its end."""
    import pickle
    import signal

    try:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # the other one says that it was interrupted
        content = pickle.dumps(_lowered(files))
        with open(to_answer, "wb") as stream:
            stream.write(content)
    finally:
        os._exit(0)


def _lowered(files: ModelFiles) -> Answer:
    import gc

    gc.disable()  # imports leave no garbage; to look for it costs time
    from hsdsl.completion import with_sliding
    from hsdsl.elaborate import elaborate_files
    from hsdsl.lower import lower

    gc.freeze()
    gc.enable()
    try:
        system = elaborate_files(files).system
        with applied(files.limits):
            program = sliding = lower(system)
            if system.experiment.completion != "auto":
                sliding = None
            elif (slides := with_sliding(system)) is not system:
                sliding = lower(slides)
            return program, sliding, files.with_data(system.files)
    except ModelError as error:
        return error


@atexit.register
def _end_all() -> None:
    while _begun:
        _begun.pop().end()


interrupts.before_leaving.append(_end_all)
