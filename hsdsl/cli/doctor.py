"""``hsdsl doctor``: packages, compiler and cache of this installation."""

from __future__ import annotations

import platform
import sys
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from typer import Exit

from hsdsl.cli.console import print_json
from hsdsl.cli.options import Json

NEEDED = "pyyaml pydantic sympy mpmath numpy typer matplotlib scipy clarabel pint threadpoolctl"  # of pyproject.toml
OPTIONAL = {"pandas": "tables (hsdsl[table])", "pyarrow": "parquet files (hsdsl[table])"}


def doctor(json: Json = False) -> None:
    """Check this installation: its packages, its compiler and its cache."""
    installation = _installation()
    if json:
        print_json(installation)
    else:
        print(_text(installation))
    if any(value is None for value in installation["packages"].values()):
        raise Exit(1)


def _installation() -> dict[str, Any]:
    from hsdsl import __version__
    from hsdsl.integrators import METHODS
    from hsdsl.simulate import SCHEMES

    return {
        "hsdsl": __version__,
        "python": platform.python_version(),
        "executable": sys.executable,
        "platform": platform.platform(),
        "packages": {name: _version(name) for name in NEEDED.split()},
        "optional": {name: _version(name) for name in OPTIONAL},
        **_engines(),
        "schemes": list(SCHEMES),
        "methods": list(METHODS),
    }


def _engines() -> dict[str, Any]:
    """Try what a compiled run needs: a compiler that compiles, and a folder to keep what it makes."""
    from hsdsl import cache
    from hsdsl.runtime.compiler import NoCompiler, find_compiler
    from hsdsl.runtime.kernel import runtime

    folder = cache.folder()
    try:
        compiler, failure = " ".join(find_compiler().command), None
        runtime()
    except NoCompiler as error:
        compiler, failure = None, str(error)
    return {
        "engines": ["c", "python"] if compiler else ["python"],
        "compiler": compiler,
        "compiler_failure": failure,
        "cache": str(folder),
        "cache_refused": cache.private(folder),
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
            f"  {name} {value}"
            if value
            else f"  {name}: not installed, needed for {OPTIONAL[name]}: pip install 'hsdsl[table]'"
            for name, value in found["optional"].items()
        ),
        f"engines: {', '.join(found['engines'])}",
        f"compiler: {found['compiler'] or found['compiler_failure']}",
        f"compiled code: {found['cache_refused'] or found['cache']}",
        f"schemes: {', '.join(found['schemes'])}",
        f"methods: {', '.join(found['methods'])}",
    ]
    return "\n".join(lines)
