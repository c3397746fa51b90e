"""``hsdsl explain``: the page of an error, a warning of runs or a lint rule."""

from __future__ import annotations

from typing import Annotated

from typer import Argument

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean
from hsdsl.interface.cli.completion import codes
from hsdsl.interface.cli.console import errors_reported, print_json
from hsdsl.interface.cli.options import Json

CODE = "A code such as HS111, or the name of a lint rule."


def explain(
    code: Annotated[str, Argument(metavar="CODE", help=CODE, autocompletion=codes)], json: Json = False
) -> None:
    """Explain an error, a warning of a run or a finding: its meaning, its reason, and what to write instead."""
    from hsdsl.analysis.lint import RULES
    from hsdsl.analysis.lint.pages import pages, titles

    with errors_reported(json):
        by_name = {rule.name: code for code, rule in RULES.items()}
        known = by_name.get(code.lower(), code.upper())
        if known not in titles():
            raise UsageError(f"there is no code '{code}'", did_you_mean(known, [*titles(), *by_name]))
        name = RULES[known].name if known in RULES else None
        if json:
            print_json({"code": known, "name": name, "title": titles()[known], "page": pages()[known]})
        else:
            print(f"{known} {name or ''}".strip() + "\n\n" + pages()[known])
