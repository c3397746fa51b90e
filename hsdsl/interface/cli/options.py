"""Arguments and options that several commands share, alone and in groups, with their completions."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from typer import Argument, Option

from hsdsl.analysis.metrics.table import CURVE_METRICS
from hsdsl.base.limits import NUMBERS, applied
from hsdsl.base.numbers.decimals import number_of
from hsdsl.engine.integrators import METHODS
from hsdsl.interface.cli.completion import model_files, override_names
from hsdsl.interface.cli.console import errors_reported, print_json
from hsdsl.interface.cli.texts import limit_options


def option(metavar: str, help: str, *names: str, complete: Callable[..., Any] | None = None) -> Any:
    """An option with a value."""
    return Option(*names, metavar=metavar, help=help, autocompletion=complete)


Scheme = Literal["relaxed", "located", "paoli-schatzman"]
Completion = Literal["contact", "auto", "none"]
Engine = Literal["auto", "c", "python"]
Format = Literal["text", "json", "sarif", "github"]
if TYPE_CHECKING:
    Method = Metric = str
else:
    Metric = StrEnum("Metric", {name: name for name in CURVE_METRICS})
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


WRT = "Parameters by name and initial states as initial.NAME, with commas between them."
COMPLETES = "Where transitions accumulate: contact follows guards, auto slides on surfaces of two modes, too; or none."


class Experiment(NamedTuple):
    """Options that override a model's experiment and its values."""

    overrides: Annotated[list[str] | None, overriding(SET)] = None
    until: Until = None
    scheme: Annotated[Scheme | None, option("S", "relaxed, located or paoli-schatzman.")] = None
    method: Annotated[Method | None, option("M", "A method's name, such as dopri5 or taylor, or auto.")] = None
    step: Annotated[str | None, option("H", "Fixed step size; excludes --tolerance.")] = None
    tolerance: Annotated[str | None, option("TOL", "Bound on the local error, relative to the states' scales.")] = None
    relaxation: Annotated[str | None, option("EPS", "The paper's epsilon: depth of the strips, and a time.")] = None
    completion: Annotated[Completion | None, option("C", COMPLETES)] = None

    def settings(self, **more: Any) -> dict[str, Any]:
        """Arguments of `Model.simulate`."""
        given = self._asdict()
        return values_of(given.pop("overrides")) | with_method(given) | more

    def in_numbers(self) -> bool:
        """Whether all values are numbers, and no expressions of the model's parameters."""
        given = [self.until, self.step, self.tolerance, self.relaxation]
        texts = [text for text in given if text] + [o.partition("=")[2] for o in self.overrides or ()]
        return None not in map(number_of, texts)


class Located(NamedTuple):
    """Options of runs whose derivatives are taken: an adaptive method by scheme `located`."""

    method: Annotated[Method | None, option("M", "An adaptive method, or auto.")] = None
    tolerance: Annotated[str | None, option("TOL", "Bound on the local error, relative to the scales.")] = None
    engine: EngineName = "auto"

    def settings(self, overrides: list[str] | None, **more: Any) -> dict[str, Any]:
        """Arguments of the model's method; a method or tolerance of ``--set`` counts as one of the call."""
        given, own = values_of(overrides), self._asdict()
        own |= {name: given["settings"].pop(name, None) for name in ("method", "tolerance") if own[name] is None}
        return given | with_method(own) | more


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


def split(overrides: list[str] | None) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
    """Parameters, initial values and settings of ``--set``."""
    from hsdsl.interface.model import split_overrides

    return split_overrides(overrides or ())


def values_of(overrides: list[str] | None) -> dict[str, Any]:
    """Parameters, initial values and settings of ``--set``, as arguments of `Model.simulate`."""
    return dict(zip(("parameters", "initial", "settings"), split(overrides), strict=True))


def with_method(settings: dict[str, Any]) -> dict[str, Any]:
    """Write the method as its name."""
    return settings | {"method": settings["method"] and str(settings["method"])}
