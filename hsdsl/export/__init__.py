"""Export targets, each a function from a model with its settings to files; other packages may add targets.

A target of our own is a package of the same name with a function ``files(source)``. It returns every file by its path
relative to the output folder, or raises `UsageError` where the target cannot keep the model: nothing is written before.

Targets begin with `source`: a model, its problem, and what all of them read of it. Documents share `automata`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Literal

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean
from hsdsl.base.plugins import Table, function_expected

if TYPE_CHECKING:
    from hsdsl.base.atomic import New
    from hsdsl.export.source import ExportedModel, Source

__all__ = [
    "ABOUT",
    "TARGETS",
    "Modes",
    "check_folder",
    "check_scheme",
    "check_target",
    "files_of",
    "source_of",
    "write",
]

ABOUT = {
    "c": "a program in C99 that allocates nothing",
    "fmi2": "a functional mock-up unit of FMI 2.0, for model exchange and co-simulation",
    "fmi3": "a functional mock-up unit of FMI 3.0, for model exchange and co-simulation",
    "jax": "a module for JAX, whose simulators vectorise and differentiate",
    "latex": "the model as mathematics, a LaTeX document",
    "matlab": "functions for MATLAB and GNU Octave, and runs in C",
    "mermaid": "the mode graph as a Mermaid diagram",
    "sbml": "a model in SBML, Level 3, with events",
    "rust": "a crate for Rust without its standard library",
    "web": "one HTML page that runs the model in a browser",
}
Files = Callable[..., dict[str, bytes]]
_OWN = {name: f"hsdsl.export.{name}:files" for name in ABOUT} | {
    f"fmi{version}": f"hsdsl.export.fmi:files{version}" for version in (2, 3)
}
TARGETS = Table[Files]("targets", _OWN, function_expected("a function files(source)"))

Modes = Literal["local", "output", "none"]  # what the number of the mode is in a functional mock-up unit
DOCUMENTS = ("latex", "mermaid", "sbml")  # targets that do not run
OF_PARTS = ("c", "fmi2", "fmi3", "latex", "matlab", "mermaid", "rust", "web")  # targets that keep systems of parts


def source_of(model: ExportedModel, arguments: Mapping[str, Any]) -> Source:
    """The source of a model with arguments of `Model.simulate` (`hsdsl.export.source`, imported when it is called)."""
    from hsdsl.export.source import source_of

    return source_of(model, arguments)


def files_of(source: Source, target: str, modes: Modes | None = None) -> dict[str, bytes]:
    """The files of a target by their relative paths, in memory.

    ``modes`` says what the number of the mode is in a functional mock-up unit: local, if left out.

    Raises UsageError: an unknown target, or a model that the target cannot keep.
    """
    check_target(target)
    if modes is not None and not target.startswith("fmi"):
        raise UsageError(f"{target} has no choice of what the mode is", "--mode belongs to --to fmi2 and --to fmi3")
    make = TARGETS[target]
    if source.system.parts and target not in OF_PARTS and not getattr(make, "keeps_parts", False):
        hint = f"--to {' or '.join(OF_PARTS)}, or write the modes of a small one out"
        raise UsageError(f"{target} has no systems of parts", hint)
    return make(source, *([] if modes is None else [modes]))


def check_target(target: str) -> None:
    """Refuse a target that there is not."""
    if target not in TARGETS:
        hint = did_you_mean(target, TARGETS, f"choose from {', '.join(TARGETS)}")
        raise UsageError(f"there is no export target '{target}'", hint)


def check_scheme(model: ExportedModel, target: str, arguments: Mapping[str, Any]) -> None:
    """Refuse a scheme that no code has, before anything else about it: the two documents of a model have none."""
    check_target(target)
    given = {"scheme": arguments.get("scheme"), "step": 1}  # a step, since some schemes are refused without one
    scheme = model.pipeline.resolve(arguments.get("settings"), given).values["scheme"].value
    if scheme == "paoli-schatzman" and target not in DOCUMENTS:
        raise UsageError(f"{target} has no scheme '{scheme}'", "--scheme relaxed or --scheme located")


def check_folder(folder: Path, force: bool) -> None:
    """Refuse an output folder that is no folder, or that has entries and no ``force``."""
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"--out {folder}: expected a folder, got a file")
    if folder.is_dir() and not force and any(folder.iterdir()):
        raise UsageError(f"--out {folder}: the folder is not empty", "--force writes over the files of an export")


def write(files: Mapping[str, bytes], folder: Path, force: bool = False) -> list[Path]:
    """Write files into a folder, which is made: all of them under other names first, so that a failure leaves none.

    Raises UsageError: the folder has entries and ``force`` is not given, or it cannot be written.
    """
    from hsdsl.base.atomic import unplaced

    check_folder(folder, force)
    paths, folders = [folder / PurePosixPath(name) for name in files], list[Path]()
    try:
        with ExitStack() as parts:
            whole: list[New] = []
            for path, content in zip(paths, files.values(), strict=True):
                _make(path.parent, folders)
                whole.append(parts.enter_context(unplaced(path)))
                whole[-1].file.write(content)
                whole[-1].finish()
            for new in whole:
                new.place()
    except BaseException:
        for made in reversed(folders):
            with suppress(OSError):  # a file of an earlier export is in it
                made.rmdir()
        raise
    return paths


def _make(folder: Path, made: list[Path]) -> None:
    """Make a folder and those it is in; ``made`` gets those that there were not, the outer first."""
    made += [each for each in reversed((folder, *folder.parents)) if not each.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot write {folder}: {error.strerror or error}") from error
