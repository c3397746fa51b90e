"""Arguments and options that several commands share: alone, in groups, their values and their completions in shells."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from typer import Argument, Context, Option

import hsdsl
from hsdsl.base.defaults import COMPLETIONS, SCHEMES, SETTINGS
from hsdsl.base.errors import CODES, WARNINGS, ModelError, UsageError
from hsdsl.base.limits import DEFAULT, NUMBERS, Limits, applied
from hsdsl.base.names import did_you_mean, without_memory
from hsdsl.engine.integrators import METHODS
from hsdsl.interface.cli.console import errors_reported, print_json

SUFFIXES = (".yaml", ".yml")


def model_files(incomplete: str) -> list[str]:
    """Model files, and folders; the content of a folder where it is the only candidate."""
    while True:
        head, _, start = incomplete.rpartition("/")
        prefix = incomplete[: len(incomplete) - len(start)]
        folder = Path(head or ("/" if prefix else "."))
        candidates = sorted(
            f"{prefix}{path.name}{'/' * path.is_dir()}"
            for path in (folder.iterdir() if folder.is_dir() else ())
            if path.name.startswith(start) and (path.is_dir() or path.suffix in SUFFIXES)
            if start.startswith(".") or not path.name.startswith(".")
        )
        if len(candidates) != 1 or not candidates[0].endswith("/"):
            return candidates
        incomplete = candidates[0]


def override_names(ctx: Context, incomplete: str) -> list[str]:
    """Names for ``--set`` of the model on the command line, with ``=``."""
    from hsdsl.engine.preparation.options import KEYS

    try:  # the option has no value yet, so the words before it are not assigned to arguments
        program = hsdsl.load(Path(ctx.args[0])).program
    except (IndexError, ModelError, UsageError):
        return []
    states = without_memory(program.modes[program.initial_mode].states)
    names = [*program.parameters, "initial.mode", *(f"initial.{state}" for state in states)]
    return [f"{name}=" for name in (*names, *(f"experiment.{key}" for key in KEYS)) if name.startswith(incomplete)]


def rule_codes(incomplete: str) -> list[tuple[str, str]]:
    """Codes of lint rules with their titles, after the last comma."""
    listed, comma, _ = incomplete.rpartition(",")
    return [(f"{listed}{comma}{code}", title) for code, title in codes() if code not in {*CODES, *WARNINGS}]


def codes() -> list[tuple[str, str]]:
    """Codes of errors, warnings of runs and lint rules with their titles."""
    from hsdsl.analysis.lint.pages import titles

    return list(titles().items())


STATE = "state or output "
PICTURES = (".png", ".svg")


def names_of(text: str | None) -> list[str]:
    """The names in a text with commas between them."""
    return [part.strip() for part in (text or "").split(",") if part.strip()]


def known_names(
    text: str | None, known: Sequence[str], name: str, kind: str = "", inputs: Sequence[str] = ()
) -> tuple[str, ...]:
    """The names in a text with commas between them; ``kind`` says in an error what they name, and ``inputs`` do not.

    Raises UsageError: one of them is not known.
    """
    names = names_of(text)
    for each in names:
        if each not in known:
            given = f"it is an input: write outputs: {{{each}: {each}}}" if each in inputs else None
            raise UsageError(f"{name}: there is no {kind}'{each}'", given or did_you_mean(each, known))
    return tuple(names)


def numbers_of(
    name: str, pairs: Sequence[str] | None, example: str, kinds: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The numbers of NAME=NUMBER, of a repeated name the last; with ``kinds`` only these names, with these types.

    Raises UsageError: a text is not of that form.
    """
    found: dict[str, Any] = {}
    for pair in pairs or ():
        key, _, value = (part.strip() for part in pair.partition("="))
        kind = kinds.get(key) if kinds else float if key else None
        try:
            if kind is not None:
                found[key] = kind(float(value))
                continue
        except (ValueError, OverflowError):
            if kinds:
                raise UsageError(f"{name} {key}: expected a number, got '{value}'") from None
        hint = did_you_mean(key, kinds) if kinds else f"for example {name} {example}"
        raise UsageError(f"{name}: expected NAME=NUMBER, got '{pair}'", hint)
    return found


def pairs_of(texts: list[str] | None, known: Sequence[str]) -> list[tuple[str, str]] | None:
    """Read ``--phase``; None where it is left out.

    Raises UsageError: no pair, or no such state or output.
    """
    pairs: list[tuple[str, str]] = []
    for text in texts or ():
        if text.count(",") != 1 or len(names_of(text)) != 2:
            raise UsageError(f"--phase: expected two names with a comma between them, got '{text}'")
        first, second = known_names(text, known, "--phase", STATE)
        pairs.append((first, second))
    return pairs or None


def check_target(
    path: Path | None,
    option: str,
    suffixes: Sequence[str] = PICTURES,
    others: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> None:
    """Refuse a file that could not be written before a long run, not after it.

    ``others`` has the suffixes of the files that other options of the verb write.
    """
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        known = " or ".join(filter(None, (", ".join(suffixes[:-1]), suffixes[-1])))
        meant = next((name for name, own in others.items() if path.suffix.lower() in own), None)
        raise UsageError(f"{option} {path}: the name must end in {known}", meant and f"{meant} {path} writes that")
    if not path.parent.is_dir():
        raise UsageError(f"{option} {path}: there is no folder {path.parent}")
    if path.suffix.lower() == ".parquet":
        from hsdsl.engine.execution.records import optional

        optional("pyarrow", f"{option} {path}")


def option(metavar: str, help: str, *names: str, complete: Callable[..., Any] | None = None) -> Any:
    """An option with a value."""
    return Option(*names, metavar=metavar, help=help, autocompletion=complete)


Engine = Literal["auto", "c", "python"]
Format = Literal["text", "json", "sarif", "github"]
if TYPE_CHECKING:
    Scheme = Completion = str
else:
    Scheme = StrEnum("Scheme", {name: name for name in SCHEMES})
    Completion = StrEnum("Completion", {name: name for name in COMPLETIONS})

Model = Annotated[Path, Argument(metavar="MODEL", help="The model file.", autocompletion=model_files)]
Models = Annotated[list[Path], Argument(metavar="MODEL...", help="Model files.", autocompletion=model_files)]
Formatted = Annotated[Format, Option("--format", metavar="|".join(Format.__args__), help="Format of the findings.")]
Json = Annotated[bool, Option("--json", help="Print one JSON object on standard output.")]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Print no summary and no progress.")]
FOLDER = "Let models also read data files from this folder. May be repeated."
LIMIT = f"Raise a limit on the resources of a model: {', '.join(NUMBERS[:-1])} or {NUMBERS[-1]}. May be repeated."
SET = (
    "Override a parameter (c=0.8), an initial value (initial.v=20), the initial mode or a setting"
    " (experiment.step=1e-3). May be repeated; values are expressions of parameters."
)
AS_RUN = "Override a parameter, an initial value or a setting, as `hsdsl run` does. May be repeated."
PAIR = "Draw one state or output against another. May be repeated."


def setting(name: str) -> Any:
    """The option of a setting of an experiment."""
    complete = (lambda: ["auto", *METHODS]) if name == "method" else None
    return option(SETTINGS[name].metavar, SETTINGS[name].about, complete=complete)


Until = Annotated[str | None, setting("until")]
EngineName = Annotated[Engine, option("ENGINE", "auto, c or python.")]
Phases = Annotated[list[str] | None, option("X,Y", PAIR, "--phase")]
AllowPath = Annotated[list[Path] | None, option("FOLDER", FOLDER)]
Limit = Annotated[list[str] | None, option("NAME=NUMBER", LIMIT)]


def overriding(help: str) -> Any:
    return option("NAME=VALUE", help, "--set", complete=override_names)


WRT = "Parameters (NAME) and initial states (initial.NAME), separated by commas."


class Experiment(NamedTuple):
    """Options that override a model's experiment and its values."""

    overrides: Annotated[list[str] | None, overriding(SET)] = None
    until: Until = None
    scheme: Annotated[Scheme | None, setting("scheme")] = None
    method: Annotated[str | None, setting("method")] = None
    step: Annotated[str | None, setting("step")] = None
    tolerance: Annotated[str | None, setting("tolerance")] = None
    relaxation: Annotated[str | None, setting("relaxation")] = None
    completion: Annotated[Completion | None, setting("completion")] = None

    def settings(self, **more: Any) -> dict[str, Any]:
        """Arguments of `Model.simulate`."""
        given = self._asdict()
        return values_of(given.pop("overrides")) | {name: value and str(value) for name, value in given.items()} | more


class Located(NamedTuple):
    """Options of runs whose derivatives are taken: an adaptive method by scheme `located`."""

    method: Annotated[str | None, option("M", "An adaptive method, or auto.")] = None
    tolerance: Annotated[str | None, option("TOL", "Bound on the local error, relative to the scales.")] = None
    engine: EngineName = "auto"

    def settings(self, overrides: list[str] | None, **more: Any) -> dict[str, Any]:
        """Arguments of the model's method; a method or tolerance of ``--set`` counts as one of the call."""
        given, own = values_of(overrides), self._asdict()
        own |= {name: given["settings"].pop(name, None) for name in ("method", "tolerance") if own[name] is None}
        return given | own | more


class Answer(NamedTuple):
    """Options for the output of a command, and for the files and resources that a model may use."""

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
    folders = allow_path or ()
    kinds: dict[str, Any] = {name: type(getattr(DEFAULT, name)) for name in NUMBERS}
    with errors_reported(json):
        numbers = numbers_of("--limit", limit, "", kinds)
        for folder in folders:
            if not folder.is_dir():
                raise UsageError(f"--allow-path {folder}: there is no such folder")
        with applied(Limits(**numbers, folders=tuple(folders))):
            yield


def values_of(overrides: list[str] | None) -> dict[str, Any]:
    """Parameters, initial values and settings of ``--set``, as arguments of `Model.simulate`."""
    from hsdsl.interface.model import split_overrides

    return dict(zip(("parameters", "initial", "settings"), split_overrides(overrides or ()), strict=True))
