"""``hsdsl doctor``: packages, compiler and cache of this installation."""

from __future__ import annotations

import platform
import sys
from importlib.metadata import PackageNotFoundError, entry_points, version
from typing import Annotated, Any

from typer import Exit, Option

from hsdsl import __version__
from hsdsl.interface.cli.console import print_json
from hsdsl.interface.cli.options import Json

NEEDED = "pyyaml pydantic sympy mpmath numpy typer matplotlib scipy clarabel pint threadpoolctl"  # of pyproject.toml
Forget = Annotated[bool, Option("--forget", help="Try again to compile models that took too long.")]
OPTIONAL = {"pandas": "tables (hsdsl[table])", "pyarrow": "parquet files (hsdsl[table])"}


def doctor(json: Json = False, forget: Forget = False) -> None:
    """Check this installation: its packages, its compiler and its cache."""
    from hsdsl.base import cache
    from hsdsl.base.defaults import SCHEMES
    from hsdsl.base.plugins import TABLES
    from hsdsl.engine.integrators import METHODS
    from hsdsl.engine.runtime.compiler import NoCompiler, find_compiler
    from hsdsl.engine.runtime.kernel import runtime
    from hsdsl.engine.runtime.library import GIVEN_UP

    if forget:
        cache.forget(GIVEN_UP)
    compiler = failure = None
    try:
        compiler = " ".join(find_compiler().command)
        runtime()
    except NoCompiler as error:
        compiler, failure = None, str(error)
    installation: dict[str, Any] = {
        "hsdsl": __version__,
        "python": platform.python_version(),
        "executable": sys.executable,
        "platform": platform.platform(),
        "packages": {name: _version(name) for name in NEEDED.split()},
        "optional": {name: _version(name) for name in OPTIONAL},
        "engines": ["c", "python"] if compiler else ["python"],
        "compiler": compiler,
        "compiler_failure": failure,
        "cache": str(cache.folder()),
        "cache_refused": cache.private(cache.folder()),
        "given_up": cache.entries(GIVEN_UP),
        "schemes": list(SCHEMES),
        "methods": list(METHODS),
        "plug_ins": {table: sorted(entry_points(group=f"hsdsl.{table}").names) for table in TABLES},
    }
    if json:
        print_json(installation)
    else:
        absent = "not installed, needed for {}: pip install 'hsdsl[table]'"
        lines = [
            f"hsdsl {installation['hsdsl']}, Python {installation['python']} on {installation['platform']}",
            *(f"  {name} {value or 'MISSING'}" for name, value in installation["packages"].items()),
            *(
                f"  {name}: {value or absent.format(OPTIONAL[name])}"
                for name, value in installation["optional"].items()
            ),
            f"engines: {', '.join(installation['engines'])}",
            f"compiler: {installation['compiler'] or installation['compiler_failure']}",
            f"compiled code: {installation['cache_refused'] or installation['cache']}",
            f"models that took too long to compile, and are not tried again: {installation['given_up']}",
            f"schemes: {', '.join(installation['schemes'])}",
            f"methods: {', '.join(installation['methods'])}",
            *(f"plug-ins: {table} {', '.join(names)}" for table, names in installation["plug_ins"].items() if names),
        ]
        print("\n".join(lines))
    if any(value is None for value in installation["packages"].values()):
        raise Exit(1)


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
