"""``hsdsl explain``: the page of an error or of a lint rule."""

from __future__ import annotations

import click

from hsdsl.cli.console import errors_reported
from hsdsl.errors import UsageError
from hsdsl.names import did_you_mean


@click.command()
@click.argument("code", metavar="CODE", help="A code such as HS111, or the name of a lint rule.")
@click.option("--json", is_flag=True, help="Print one JSON object.")
def explain(code: str, json: bool) -> None:
    """Say what an error or a finding means, why, and what to write instead."""
    from hsdsl.lint import RULES
    from hsdsl.lint.pages import pages, titles
    from hsdsl.report import dumps

    with errors_reported(json):
        by_name = {rule.name: code for code, rule in RULES.items()}
        found = by_name.get(code.lower(), code.upper())
        if found not in titles():
            raise UsageError(f"there is no code '{code}'", did_you_mean(found, [*titles(), *by_name]))
        name = RULES[found].name if found in RULES else None
        if json:
            print(dumps({"code": found, "name": name, "title": titles()[found], "page": pages()[found]}))
        else:
            print(f"{found} {name or ''}".strip() + "\n\n" + pages()[found])
