"""A C compiler that compiles the loop once: of the same text with the same flags it keeps the object.

The user's cache has the objects, for all processes and further runs. Their names depend on the preprocessed text, the
flags and the compiler's version, so that no object of other code is found. What prints warnings is not kept.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[2]))

from hsdsl.base import cache

KIND = "objects-of-tests"
LOOP = "runtime/hs.c"


def _copied(source: Path, target: Path) -> None:
    target.write_bytes(source.read_bytes())


def compile_once(compiler: list[str], flags: list[str], source: str, target: Path) -> int:
    """Compile a file to an object, or take what was kept; returns the exit code."""

    def printed(*words: str) -> bytes:
        return subprocess.run([*compiler, *words], stdout=subprocess.PIPE, check=True).stdout

    named = [flag for flag in flags if not flag.startswith("-I")]
    key = cache.key_of(repr((compiler, named)), printed("--version"), printed(*flags, "-E", "-P", source))
    with cache.making(KIND, key):
        if kept := cache.find(KIND, key):
            shutil.copyfile(kept, target)
            return 0
        command = [*compiler, *flags, "-c", "-o", str(target), source]
        done = subprocess.run(command, stderr=subprocess.PIPE)
        sys.stderr.write(done.stderr.decode())
        if done.returncode == 0 and not done.stderr:
            with suppress(OSError):
                cache.keep(KIND, key, ".o", lambda path: _copied(target, path))
        return done.returncode


def compile_like_cc(words: list[str]) -> int:
    """Do what `cc` does with these words, the loop apart."""
    loop = next((word for word in words if word.endswith(LOOP)), None)
    if loop is None or "-E" in words or ("-c" in words and "-o" not in words):
        return subprocess.run([CC, *words]).returncode
    target = words[words.index("-o") + 1] if "-o" in words else ""
    others = [word for word in words if word not in ("-c", "-o", target) and word[:2] != "-l"]
    flags = [word for word in others if not word.endswith((".c", ".o"))]
    if "-c" in words:
        return compile_once([CC], flags, loop, Path(target))
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "hs.o"
        code = compile_once([CC], flags, loop, made)
        return code or subprocess.run([CC, *(str(made) if word == loop else word for word in words)]).returncode


CC = os.environ.get("HSDSL_TESTS_CC") or shutil.which("cc") or "cc"  # another `cc` may stand before it in PATH

if __name__ == "__main__":
    sys.exit(compile_like_cc(sys.argv[1:]))
