"""The C that runs: no warning of any compiler here, no fault under the address and undefined-behaviour sanitizers."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import hsdsl
from hsdsl.engine.backends.c.source import model_source
from hsdsl.engine.runtime.compiler import FLAGS
from hsdsl.engine.runtime.library import RUNTIME, print_scheme

TESTS = Path(__file__).parents[1]
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
WARNINGS = ("-Wall", "-Wextra", "-Werror", "-pedantic")
SANITIZERS = "-fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer -g1"


@pytest.mark.parametrize("compiler", COMPILERS)
def test_no_warnings(compiler: str, tmp_path: Path) -> None:
    (tmp_path / "library.c").write_text(f'#include "{RUNTIME / "library.c"}"\n')
    for path in sorted((TESTS.parent / "models").glob("*.yaml")):
        (tmp_path / f"{path.stem}.c").write_text(model_source(hsdsl.load(path).program))
    for source in tmp_path.glob("*.c"):
        command = [
            compiler,
            *FLAGS,
            *WARNINGS,
            f"-I{RUNTIME}",
            f"-I{print_scheme(tmp_path)}",
            "-o",
            str(tmp_path / "x.so"),
            str(source),
            "-lm",
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def _with_all_addresses() -> None:
    """Lift the limit on addresses: sanitizers need most of them."""
    import resource

    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


@pytest.mark.minutes
@pytest.mark.parametrize(
    "most", [pytest.param([], marks=pytest.mark.slow, id="some"), pytest.param(["all"], marks=pytest.mark.campaign)]
)
@pytest.mark.skipif("gcc" not in COMPILERS or sys.platform != "linux", reason="needs gcc's sanitizers")
def test_no_fault_under_sanitizers(most: list[str], tmp_path: Path) -> None:
    libraries = [
        subprocess.run(["gcc", f"-print-file-name={name}"], capture_output=True, text=True, check=True).stdout.strip()
        for name in ("libasan.so", "libubsan.so")
    ]
    if not all(map(os.path.isabs, libraries)):
        pytest.skip("gcc has no sanitizers here")
    environment = os.environ | {
        "CC": f"env -u LD_PRELOAD gcc {SANITIZERS} -DHS_INLINE=static",  # the compiler itself is not what is looked at
        "LD_PRELOAD": " ".join(libraries),
        "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=0",
        "PYTHONMALLOC": "malloc",
        "PYTHONPATH": os.pathsep.join([str(TESTS.parent), str(TESTS)]),
        "XDG_CACHE_HOME": str(tmp_path),
    }
    command = [sys.executable, str(TESTS / "sanitized.py"), *most]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False, preexec_fn=_with_all_addresses
    )
    assert done.returncode == 0, done.stderr[-5000:]
    assert int(done.stdout.split()[0]) > 300
