"""``hsdsl doctor``: what this installation is made of and what it can do here."""

from __future__ import annotations

import platform
import shutil
import sys
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated, Any

import typer

NEEDED = ("pyyaml", "pydantic", "sympy", "mpmath", "numpy", "typer", "rich", "matplotlib")
OPTIONAL = {"pandas": "tables (hsdsl[table])", "pyarrow": "parquet files (hsdsl[table])"}
COMPILERS = ("cc", "gcc", "clang")


def doctor(json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False) -> None:
    """Say what this installation is made of and what it can do here."""
    from hsdsl.report import dumps

    found = _found()
    print(dumps(found) if json else _text(found))
    if any(value is None for value in found["packages"].values()):
        raise typer.Exit(1)


def _found() -> dict[str, Any]:
    from hsdsl import __version__
    from hsdsl.integrators import METHODS
    from hsdsl.simulate import SCHEMES

    return {
        "hsdsl": __version__,
        "python": platform.python_version(),
        "executable": sys.executable,
        "platform": platform.platform(),
        "packages": {name: _version(name) for name in NEEDED},
        "optional": {name: _version(name) for name in OPTIONAL},
        "engines": ["python"],
        "compilers": [name for name in COMPILERS if shutil.which(name)],
        "schemes": list(SCHEMES),
        "methods": list(METHODS),
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _text(found: dict[str, Any]) -> str:
    lines = [
        f"hsdsl {found['hsdsl']}, Python {found['python']} on {found['platform']}",
        *(f"  {name} {value or 'MISSING'}" for name, value in found["packages"].items()),
        *(
            f"  {name} {value}" if value else f"  {name}: not installed, needed for {OPTIONAL[name]}"
            for name, value in found["optional"].items()
        ),
        "engine: python (there is no compiled engine yet"
        + (f"; compilers here: {', '.join(found['compilers'])})" if found["compilers"] else ")"),
        f"schemes: {', '.join(found['schemes'])}",
        f"methods: {', '.join(found['methods'])}",
    ]
    return "\n".join(lines)
