"""The page of the command line, from the program itself."""

from __future__ import annotations

from typing import Any

from typer import Context
from writing.markdown import table

from hsdsl.interface.cli.verbs import VERBS, command

COMMAND_LINE = """# Command line

Answers go to standard output, messages and progress to standard error.

| exit code | meaning |
| --- | --- |
| 0 | the run reached `until` or a final mode; the model has no errors |
| 1 | the model has errors |
| 2 | wrong usage, or a file that cannot be read |
| 3 | the run stopped for [another reason](../meaning.md#m10-stop) |
| 130 | interrupted; what was computed is kept |

`hsdsl --install-completion` lets bash, zsh, fish or PowerShell complete commands, options, their choices, model files,
names of `--set`, and codes.

"""


def command_line() -> str:
    """Document every verb and option from the program itself."""
    parts = [COMMAND_LINE]
    for name in VERBS:
        verb = command(name)
        context = Context(verb)
        parts.append(f"## hsdsl {name}\n\n{(verb.help or '').strip()}\n\n")
        parameters = [p for p in verb.params if p.name != "help"]
        rows = [(as_typed(p, context), (getattr(p, "help", None) or "").strip()) for p in parameters]
        parts.append(table(("argument or option", "meaning"), rows) if rows else "")
    return "".join(parts)


def as_typed(parameter: Any, context: Context) -> str:
    """Name a parameter as one would type it."""
    if parameter.param_type_name == "argument":
        return f"`{(parameter.metavar or parameter.name).upper()}`"
    names = ", ".join(f"`{name}`" for name in (*parameter.opts, *parameter.secondary_opts))
    return names if parameter.is_flag else f"{names} `{parameter.make_metavar(context)}`"
