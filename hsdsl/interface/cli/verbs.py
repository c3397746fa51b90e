"""The commands by name, each in a module that is imported when the command runs."""

from __future__ import annotations

import os
import re
import shlex
import sys
from collections.abc import Callable
from importlib import import_module
from inspect import Parameter, Signature, signature
from keyword import iskeyword
from typing import Annotated, Any, cast, get_type_hints

from typer import Abort, Context, Exit, Option, Typer, TyperException
from typer.core import TyperGroup
from typer.main import get_command

from hsdsl.base.errors import UsageError
from hsdsl.base.interrupts import INTERRUPTED, WORD
from hsdsl.base.names import did_you_mean, visible

VERBS = {  # with their modules
    "run": "run", "plot": "runs", "sweep": "sweep", "validate": "check", "lint": "check", "explain": "check",
    "distance": "runs", "sensitivity": "derivatives", "orbit": "derivatives", "fit": "derivatives", "chart": "charts",
    "stability": "charts", "complete": "convert", "export": "convert", "import": "convert", "schema": "convert",
    "doctor": "doctor",
}  # fmt: skip
COMPLETE = "_HSDSL_COMPLETE"  # set by a shell that completes a command line
_UNKNOWN = r"No such (?:option|command):? '?([\w-]+)"
_EXTRA = r"unexpected extra argument\S* \((.+)\)"
_OVERRIDE = r"[\w.\[\]]+=.+"
_PAIRS = ("--set", "--vary", "--limit")  # options of NAME=VALUE
_MODELS = (".yaml", ".yml", ".json")
_OF_OTHERS = {
    "run": "simulate sim solve start",
    "validate": "check verify parse",
    "plot": "draw show view",
    "export": "convert codegen generate compile build",
    "--until": "--t_end --t-end --tend --end --time --duration --tmax --stop --stop-time --horizon",
    "--set": "--param --params --parameter --parameters --override --initial --init --define -D -p",
    "--out": "--output --save --outfile --csv -o",
    "--plot": "--figure --fig --show --png",
    "--tolerance": "--tol --rtol --atol --reltol --abstol",
    "--step": "--dt --stepsize --step-size -h",
    "--method": "--solver --integrator",
    "--vary": "--sweep --grid --range",
}
SETTINGS = {"help_option_names": ["--help", "-h"], "show_default": True}


def command(verb: str) -> Any:
    """Import a command."""
    single = Typer(add_completion=False, rich_markup_mode=None)
    name = f"{verb}_" if iskeyword(verb) else verb
    module = import_module(f"hsdsl.interface.cli.{VERBS[verb]}")
    single.command(verb, context_settings=SETTINGS)(flat(getattr(module, name)))
    return get_command(single)


def flat(command: Callable[..., None]) -> Callable[..., None]:
    """A command in which each group of options, a named tuple, is replaced by its options."""
    groups: dict[str, type[Any]] = {}
    parameters: list[Parameter] = []
    for parameter in signature(command, eval_str=True).parameters.values():
        group = parameter.annotation
        if hasattr(group, "_fields"):
            groups[parameter.name] = group
            kinds = get_type_hints(group, include_extras=True)
            defaults = group._field_defaults
            parameters += [_option(name, kinds[name], default=defaults[name]) for name in kinds]
        else:
            parameters.append(_option(parameter.name, group, default=parameter.default))

    def run(**values: Any) -> None:
        for name, group in groups.items():
            values[name] = group(**{field: values.pop(field) for field in group._fields})
        command(**values)

    run.__doc__ = command.__doc__
    run.__signature__ = Signature(parameters)  # pyright: ignore[reportFunctionMemberAccess]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def _option(name: str, kind: Any, default: Any) -> Parameter:
    return Parameter(name, Parameter.KEYWORD_ONLY, annotation=kind, default=default)


class _Verbs(TyperGroup):
    """The group of all commands."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = cast("dict[str, Any]", dict.fromkeys(VERBS))  # names, for lists and suggestions

    def get_command(self, ctx: Context, cmd_name: str) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        return command(cmd_name) if cmd_name in VERBS else None


app = Typer(cls=_Verbs, name="hsdsl", no_args_is_help=True, rich_markup_mode=None, context_settings=SETTINGS)


def _version(given: bool) -> None:
    from hsdsl import __version__

    if given:
        print(f"hsdsl {__version__}")
        raise Exit


@app.callback()
def hsdsl(
    version: Annotated[bool, Option("--version", callback=_version, is_eager=True, help="Print the version.")] = False,
) -> None:
    """Hybrid systems written as mathematics in YAML: checked, simulated, measured."""


def obey(words: list[str]) -> int:
    """Run a command line and return the exit code."""
    if COMPLETE in os.environ:
        get_command(app).main(words, prog_name="hsdsl")
    alone = bool(words) and words[0] in VERBS  # without the group, whose options take long to import
    try:
        verb = command(words[0]) if alone else get_command(app)
        with verb.make_context(f"hsdsl {words[0]}" if alone else "hsdsl", words[alone:]) as context:
            verb.invoke(context)
    except Exit as end:
        return end.exit_code
    except TyperException as error:
        return _report(error, words)
    except (Abort, KeyboardInterrupt):
        print(WORD, file=sys.stderr)
        return INTERRUPTED
    return 0


def _report(error: Any, words: list[str]) -> int:
    """Print what is wrong with a command line."""
    json = "--json" in words
    choices = getattr(getattr(getattr(error, "param", None), "type", None), "choices", None)
    if choices or json:
        from hsdsl.interface.cli.console import report_usage

        message, hint = error.format_message(), None
        if choices:
            value: str = error.message.split("'")[1]
            message, hint = f"there is no {error.param.name} '{value}'", did_you_mean(value, choices)
        report_usage(UsageError(message, hint), json)
    else:
        error.message = visible(error.message) if words else error.message  # else the help text
        error.show(sys.stderr)
        if meant := _meant(error) or _whole(error, words):
            print(f"  hint: write {visible(meant)}", file=sys.stderr)
    return error.exit_code


def _meant(error: Any) -> str | None:
    """The command or option that has another name in other tools."""
    name = re.search(_UNKNOWN, error.message)
    known = {*VERBS, *_options(error)}
    return next(
        (own for own, others in _OF_OTHERS.items() if name and name[1] in others.split() and own in known), None
    )


def _whole(error: Any, words: list[str]) -> str | None:
    """The command line of a model without a verb, or the override that is not one word with its option."""
    if error.message.startswith("No such command") and (words[0].endswith(_MODELS) or os.path.isfile(words[0])):
        return shlex.join(["hsdsl", "run", *words])
    extra = re.search(_EXTRA, error.message)
    stray = extra[1].split()[0] if extra else ""
    before = words[words.index(stray) - 2 :][:2] if stray in words[2:] else []
    if before and before[0] in _PAIRS and "=" not in before[1]:
        return f"{before[0]} {before[1]}={stray}"
    return f"--set {stray}" if re.fullmatch(_OVERRIDE, stray) and "--set" in _options(error) else None


def _options(error: Any) -> set[str]:
    return {each for option in getattr(getattr(error.ctx, "command", None), "params", ()) for each in option.opts}
