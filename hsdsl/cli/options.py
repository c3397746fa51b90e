"""Arguments and options that several commands share, alone and in groups, with their completions."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import AbstractContextManager, contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from typer import Argument, Option

from hsdsl.cli.completion import model_files, override_names
from hsdsl.cli.console import errors_reported, print_json
from hsdsl.errors import UsageError
from hsdsl.integrators import METHODS
from hsdsl.limits import DEFAULT, NUMBERS, Limits, applied
from hsdsl.names import did_you_mean


def option(metavar: str, help: str, *names: str, complete: Callable[..., Any] | None = None) -> Any:
    """An option with a value."""
    return Option(*names, metavar=metavar, help=help, autocompletion=complete)


Scheme = Literal["relaxed", "located", "paoli-schatzman"]
Completion = Literal["contact", "auto", "none"]
Engine = Literal["auto", "c", "python"]
Metric = Literal["quotient", "relaxed", "rho", "rho-hat", "sup", "skorokhod", "tau-epsilon"]
Format = Literal["text", "json", "sarif", "github"]
if TYPE_CHECKING:
    Method = str
else:
    Method = StrEnum("Method", {name: name for name in ("auto", *METHODS)})

Model = Annotated[Path, Argument(metavar="MODEL", help="The model file.", autocompletion=model_files)]
Models = Annotated[list[Path], Argument(metavar="MODEL...", help="Model files.", autocompletion=model_files)]
Formatted = Annotated[Format, Option("--format", metavar="|".join(Format.__args__), help="Form of the findings.")]
Json = Annotated[bool, Option("--json", help="Print one JSON object on standard output.")]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Print no summary and no progress.")]
FOLDER = "Let models read data files from here too. May be repeated."
LIMIT = f"Let a model ask for more: {', '.join(NUMBERS[:-1])} or {NUMBERS[-1]}. May be repeated."
SET = (
    "Override a parameter (c=0.8), an initial value (initial.v=20), the initial mode or a setting"
    " (experiment.step=1e-3). May be repeated; values are expressions of parameters."
)
AS_RUN = "Override a parameter, an initial value or a setting, as `hsdsl run` does. May be repeated."
PAIR = "Draw one state or output against another, in one of the pictures. May be repeated."
Until = Annotated[str | None, option("T", "End of the run.")]
EngineName = Annotated[Engine, option("ENGINE", "auto, c or python.")]
Phases = Annotated[list[str] | None, option("X,Y", PAIR, "--phase")]
AllowPath = Annotated[list[Path] | None, option("FOLDER", FOLDER)]
Limit = Annotated[list[str] | None, option("NAME=NUMBER", LIMIT)]


def overriding(help: str) -> Any:
    """The option ``--set``."""
    return option("NAME=VALUE", help, "--set", complete=override_names)


class Experiment(NamedTuple):
    """Options that override a model's experiment and its values."""

    overrides: Annotated[list[str] | None, overriding(SET)] = None
    until: Until = None
    scheme: Annotated[Scheme | None, option("S", "relaxed, located or paoli-schatzman.")] = None
    method: Annotated[Method | None, option("M", "A method's name, such as dopri5 or taylor, or auto.")] = None
    step: Annotated[str | None, option("H", "Fixed step size; excludes --tolerance.")] = None
    tolerance: Annotated[str | None, option("TOL", "Bound on the local error, relative to the states' scales.")] = None
    relaxation: Annotated[str | None, option("EPS", "The paper's epsilon: depth of the strips, and a time.")] = None
    completion: Annotated[Completion | None, option("C", "Where transitions accumulate: contact, auto or none.")] = None

    def settings(self, **more: Any) -> dict[str, Any]:
        """Arguments of `Model.simulate`."""
        given = self._asdict()
        return values_of(given.pop("overrides")) | with_method(given) | more


class Located(NamedTuple):
    """Options of runs whose derivatives are taken: an adaptive method by scheme `located`."""

    method: Annotated[Method | None, option("M", "An adaptive method, or auto.")] = None
    tolerance: Annotated[str | None, option("TOL", "Bound on the local error, relative to the scales.")] = None
    engine: EngineName = "auto"

    def settings(self, overrides: list[str] | None, **more: Any) -> dict[str, Any]:
        """Arguments of the model's method."""
        return values_of(overrides) | with_method(self._asdict()) | more


class Answer(NamedTuple):
    """Options of how a command answers, and of what a model file may read and need."""

    json: Json = False
    quiet: Quiet = False
    allow_path: AllowPath = None
    limit: Limit = None

    @property
    def hidden(self) -> bool:
        """Whether progress is not shown."""
        return self.quiet or self.json

    def reporting(self) -> AbstractContextManager[None]:
        """Report errors, and apply the limits while the command runs."""
        return answering(self.json, self.allow_path, self.limit)

    def give(self, record: Callable[[], Any], text: Callable[[], str]) -> None:
        """Print a result as JSON or for a person."""
        if self.json:
            print_json(record())
        elif not self.quiet:
            print(text())


@contextmanager
def answering(json: bool, allow_path: AllowPath, limit: Limit) -> Generator[None]:
    """Report errors, and apply the limits while the command runs."""
    with errors_reported(json), applied(limit_options(allow_path or (), limit or ())):
        yield


def limit_options(folders: Sequence[Path], pairs: Sequence[str]) -> Limits:
    """Read ``--allow-path`` and ``--limit``.

    Raises
    ------
    UsageError
        No such limit, no positive number, or no such folder.
    """
    numbers: dict[str, Any] = {}
    for pair in pairs:
        name, _, value = (part.strip() for part in pair.partition("="))
        if name not in NUMBERS:
            raise UsageError(f"--limit: expected NAME=NUMBER, got '{pair}'", did_you_mean(name, NUMBERS))
        try:
            numbers[name] = type(getattr(DEFAULT, name))(float(value))
        except (ValueError, OverflowError):
            raise UsageError(f"--limit {name}: expected a number, got '{value}'") from None
    for folder in folders:
        if not folder.is_dir():
            raise UsageError(f"--allow-path {folder}: there is no such folder")
    return Limits(**numbers, folders=tuple(folders))


def split(overrides: list[str] | None) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
    """Parameters, initial values and settings of ``--set``."""
    from hsdsl.model import split_overrides

    return split_overrides(overrides or ())


def values_of(overrides: list[str] | None) -> dict[str, Any]:
    """Parameters, initial values and settings of ``--set``, as arguments of `Model.simulate`."""
    return dict(zip(("parameters", "initial", "settings"), split(overrides), strict=True))


def with_method(settings: dict[str, Any]) -> dict[str, Any]:
    """Write the method as its name."""
    return settings | {"method": settings["method"] and str(settings["method"])}


def names_of(text: str | None) -> list[str]:
    """The names in a text with commas between them."""
    return [part.strip() for part in (text or "").split(",") if part.strip()]


def known_names(text: str | None, known: Sequence[str], name: str) -> tuple[str, ...]:
    """The names in a text with commas between them.

    Raises
    ------
    UsageError
        One of them is not known.
    """
    names = names_of(text)
    for each in names:
        if each not in known:
            raise UsageError(f"{name}: there is no '{each}'", did_you_mean(each, known))
    return tuple(names)


def pairs_of(texts: list[str] | None, known: Sequence[str]) -> list[tuple[str, str]] | None:
    """Read ``--phase``; None where it is left out.

    Raises
    ------
    UsageError
        No pair, or no such state or output.
    """
    pairs: list[tuple[str, str]] = []
    for text in texts or ():
        names = [part.strip() for part in text.split(",")]
        if len(names) != 2 or not all(names):
            raise UsageError(f"--phase: expected two names with a comma between them, got '{text}'")
        for name in names:
            if name not in known:
                raise UsageError(f"--phase: there is no state or output '{name}'", did_you_mean(name, known))
        pairs.append((names[0], names[1]))
    return pairs or None


def check_target(path: Path | None, option: str, suffixes: Sequence[str]) -> None:
    """Refuse a file that could not be written before a long run, not after it."""
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        known = " or ".join(filter(None, (", ".join(suffixes[:-1]), suffixes[-1])))
        raise UsageError(f"{option} {path}: the name must end in {known}")
    if not path.parent.is_dir():
        raise UsageError(f"{option} {path}: there is no folder {path.parent}")
    if path.suffix.lower() == ".parquet":
        from hsdsl.execution.samples import optional

        optional("pyarrow", f"{option} {path}")
