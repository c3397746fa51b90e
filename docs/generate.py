"""Write the pages that the code itself knows: those of docs/reference, and the gallery of models, which are run for it.

python docs/generate.py           write docs/reference/*.md and docs/models.md
python docs/generate.py --check   write nothing; name the pages that are stale and exit 1
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from writing import codes, command_line, language, methods, mistakes, models, python_api

from hsdsl.analysis.lint.rules import FAMILIES, RULES, family

REFERENCE = Path(__file__).parent / "reference"

NOTE = "<!-- Written by docs/generate.py: edit the code it reads, not this page. -->\n\n"

PAGES: dict[str, Callable[[], str]] = {
    "language.md": language.language,
    "command-line.md": command_line.command_line,
    "python.md": python_api.python_api,
    "errors.md": codes.error_codes,
    "warnings.md": codes.warning_codes,
    "rules.md": codes.rule_index,
    **{
        f"rules/{name}.md": partial(codes.rule_family, name)
        for name in FAMILIES
        if any(family(code) == name for code in RULES)
    },
    "integrators.md": methods.integrator_page,
    "coefficients.md": methods.coefficient_page,
    "mistakes.md": mistakes.mistakes,
    "../models.md": models.model_page,
}


def render(name: str) -> str:
    """Make the text of one page."""
    return NOTE + PAGES[name]().rstrip() + "\n"


def stale() -> list[str]:
    """Name the pages that differ from what the code says."""
    return [name for name in PAGES if written(name) != render(name)]


def written(name: str) -> str | None:
    """Read a page as it is, None where there is none."""
    file = REFERENCE / name
    return file.read_text(encoding="utf-8") if file.is_file() else None


def main() -> int:
    """Write or check."""
    if "--check" in sys.argv[1:]:
        old = stale()
        for name in old:
            print(f"docs/reference/{name} is stale; run python docs/generate.py", file=sys.stderr)
        return 1 if old else 0
    (REFERENCE / "rules").mkdir(parents=True, exist_ok=True)
    for name in PAGES:
        (REFERENCE / name).write_text(render(name), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
