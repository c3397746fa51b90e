"""What is kept between runs: private, checked, made again where damaged, safe among processes, and never stale."""

from __future__ import annotations

import errno
import inspect
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from compiled_kernel import CompiledKernel
from engines import alike, needs_compiler

import hsdsl
from hsdsl.base import cache
from hsdsl.base.errors import ModelError
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.runtime import compiler, kernel, library
from hsdsl.engine.runtime.kernel import CompiledModel
from hsdsl.language.files import ModelFiles
from hsdsl.mathematics import program_cache

try:
    import fcntl
except ImportError:
    fcntl = None

ROOT = Path(__file__).parents[2]
MODELS = sorted((ROOT / "models").glob("*.yaml"))
posix = pytest.mark.skipif(not hasattr(os, "getuid"), reason="POSIX permissions")
WITH_DATA = """
hsdsl: 1
inputs: {u: {file: u.csv, hold: linear}}
modes: {m: {flow: {x: u}}}
initial: {mode: m, x: 0}
experiment: {until: 1, method: rk4, step: 0.1, scheme: relaxed}
"""
LIGHT = """
import sys, hsdsl
hsdsl.load(sys.argv[1]).simulate(engine="c")
print([name for name in sys.argv[2:] if name in sys.modules])
"""
LIGHT_COMMAND = """
import sys
from hsdsl.interface.cli.verbs import obey
obey(["run", sys.argv[1], "--json", "--engine", "c"])  # which waits for the compiler
print([name for name in sys.argv[2:] if name in sys.modules])
"""
HEAVY = ("sympy", "mpmath", "scipy", "pydantic", "yaml", "matplotlib", "pint")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of each test's own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    return tmp_path / "caches" / "hsdsl"


def write(text: str):
    return lambda path: path.write_text(text)


@posix
def test_the_folder_is_private_and_another_is_refused(folder: Path) -> None:
    cache.keep("words", "k", ".txt", write("word"))
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)
    assert "written by other users" in str(cache.private(folder))
    assert cache.find("words", "k") is None
    with pytest.raises(PermissionError):
        cache.keep("words", "k", ".txt", write("word"))


def test_a_damaged_entry_is_gone(folder: Path) -> None:
    path = cache.keep("words", "k", ".txt", write("word"))
    assert cache.find("words", "k") == path and path.read_text() == "word"
    path.write_text("wort")
    assert cache.find("words", "k") is None and not path.exists()


def test_only_so_many_entries_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "MOST_ENTRIES", 3)
    for k in range(6):
        os.utime(cache.keep("words", f"k{k}", ".txt", write("word")), (k, k))
    assert [cache.find("words", f"k{k}") is not None for k in range(6)] == [False] * 3 + [True] * 3


def test_an_entry_that_is_being_made_stays(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    monkeypatch.setattr(cache, "MOST_ENTRIES", 2)
    os.utime(cache.keep("words", "old", ".txt", write("word")), (1, 1))

    def made_beside(path: Path) -> None:
        cache.keep("words", "other", ".txt", write("other"))
        path.write_text("new")

    cache.keep("words", "new", ".txt", made_beside)
    assert cache.find("words", "new") is not None and cache.find("words", "old") is None


@needs_compiler
def test_compiled_code_is_kept_and_made_again_where_damaged(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    program, made = hsdsl.load(MODELS[0]).program, []
    monkeypatch.setattr(library, "_compile", lambda *a, original=library._compile: (made.append(1), original(*a)))
    for expected in (1, 1):
        CompiledModel(program)
        assert len(made) == expected
    (kept,) = (folder / library.KIND).rglob("*.so")
    kept.rename(folder / "old.so")  # a library that is loaded must not be written over
    kept.write_bytes(b"no library")
    assert CompiledKernel(program, CompiledModel(program)).arithmetic is FLOAT64
    assert len(made) == 2


def _belongs_to_another(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if os.getuid() == 0:
        os.chown(path, 12345, -1)
    else:
        monkeypatch.setattr(os, "getuid", lambda: 12345)


def _is_a_link(path: Path, _: pytest.MonkeyPatch) -> None:
    path.rename(path.with_name("moved"))
    path.symlink_to(path.with_name("moved"))


WAYS = [
    lambda path, _: path.chmod(0o777),
    lambda path, _: path.chmod(0o770),
    lambda path, _: path.chmod(0o1777),
    _belongs_to_another,
    _is_a_link,
]


@posix
@pytest.mark.parametrize("way", WAYS, ids=["all", "group", "sticky", "owner", "link"])
@pytest.mark.parametrize("depth", range(4), ids=["top", "kind", "key", "file"])
def test_nothing_is_taken_from_where_another_may_put_it(way, depth, folder: Path, monkeypatch) -> None:
    path = cache.keep("words", "k", ".txt", write("word"))
    place = (folder, folder / "words", folder / "words" / "k", path)[depth]
    if (place, way) == (folder, _is_a_link):
        pytest.skip("a user may move the whole folder and link to it")
    assert cache.find("words", "k") == path
    way(place, monkeypatch)
    assert cache.find("words", "k") is None
    if place != path:
        with pytest.raises(PermissionError):
            cache.keep("words", "k", ".txt", write("word"))
    elif way is not _belongs_to_another:  # it is made anew, and then it is ours
        assert cache.find("words", "k") is None and cache.keep("words", "k", ".txt", write("word")) == path
        assert cache.find("words", "k") == path


@posix
def test_the_folders_above_let_nobody_exchange_it(folder: Path) -> None:
    cache.keep("words", "k", ".txt", write("word"))
    for mode, trusted in ((0o777, False), (0o1777, True), (0o755, True)):
        folder.parent.chmod(mode)
        assert (cache.find("words", "k") is not None, cache.private(folder) is None) == (trusted, trusted)


@needs_compiler
@posix
@pytest.mark.parametrize("depth", range(3), ids=["kind", "key", "file"])
def test_a_foreign_library_is_not_loaded(depth, monkeypatch: pytest.MonkeyPatch, folder: Path, capsys) -> None:
    program, loaded = hsdsl.load(MODELS[0]).program, []
    CompiledModel(program)
    kept = list((folder / library.KIND).rglob("*.so"))
    for path in kept:  # with a name that agrees with its content, as a stranger would do it
        foreign = path.with_name(cache._checksum(b"foreign") + ".so")
        path.unlink()
        foreign.write_bytes(b"foreign")
        (folder / library.KIND, foreign.parent, foreign)[depth].chmod(0o777)
    monkeypatch.setattr(library.ctypes, "CDLL", lambda p, load=library.ctypes.CDLL: (loaded.append(p), load(p))[1])
    kernel.runtime.cache_clear()
    CompiledModel(program)
    assert loaded and not any(Path(path).stem == cache._checksum(b"foreign") for path in loaded)
    assert ("can be written by other users" in capsys.readouterr().err) == (depth < 2)


RUN = [sys.executable, "-m", "hsdsl", "run", str(MODELS[0]), "--json", "--engine", "c", "--scheme", "relaxed"]
READ_ONLY = "mount --bind {0} {0} && mount -o remount,bind,ro {0} && ! touch {0}/x 2>/dev/null && "


@needs_compiler
@posix
def test_a_full_cache_on_a_read_only_file_system_serves(folder: Path, tmp_path: Path, with_loop) -> None:
    if subprocess.run(["unshare", "-rm", "true"], capture_output=True).returncode:
        pytest.skip("no name spaces here")
    with_loop()
    subprocess.run(RUN, check=True, capture_output=True)
    before = sorted(folder.rglob("*"))
    code = "import hsdsl.engine.runtime.library as l; l._compile = None; from hsdsl.interface.cli import main; main()"
    served = ["unshare", "-rm", "sh", "-c", READ_ONLY.format(tmp_path / "caches") + 'exec "$@"', "-"]
    done = subprocess.run([*served, sys.executable, "-c", code, *RUN[3:]], capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    assert sorted(folder.rglob("*")) == before
    new = subprocess.run([*served, *RUN, "--set", "experiment.method=dopri5"], capture_output=True, text=True)
    assert new.returncode == 0 and "Traceback" not in new.stderr


def test_those_who_keep_find_and_remove_at_once_find_whole_entries_or_none(folder: Path) -> None:
    texts, wrong = [str(k) * 50_000 for k in range(3)], []

    def keeps(text: str) -> None:
        with suppress(OSError):  # its entry was removed under it: then nothing is kept
            cache.keep("words", "k", ".txt", write(text))

    def finds() -> None:
        path = cache.find("words", "k")
        with suppress(FileNotFoundError):
            if path is not None and path.read_text() not in texts:
                wrong.append(path)

    def removes() -> None:
        time.sleep(1e-3)
        shutil.rmtree(folder / "words", ignore_errors=True)

    def repeat(what: Callable[[], None]) -> None:
        try:
            for _ in range(200):
                what()
        except BaseException as error:
            wrong.append(error)

    work = [*(partial(keeps, text) for text in texts), finds, finds, removes]
    threads = [threading.Thread(target=repeat, args=[what]) for what in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert not wrong and not any(thread.is_alive() for thread in threads)
    keeps(texts[0])
    assert cache.find("words", "k") is not None and not list(folder.rglob("*.part"))


@posix
def test_what_cannot_be_touched_is_found_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    path = cache.keep("words", "k", ".txt", write("word"))

    def refused(*_, **__):
        raise OSError(errno.EROFS, "Read-only file system")

    for step in ("utime", "mkdir", "chmod", "replace", "unlink"):
        monkeypatch.setattr(os, step, refused)
    assert cache.find("words", "k") == path
    path.write_text("wort")
    assert cache.find("words", "k") is None  # damaged, and cannot be removed


def test_what_a_killed_process_left_goes_with_the_next_entry(folder: Path) -> None:
    cache.keep("kind", "key", ".txt", lambda target: open(target, "w").close())
    (folder / "kind" / ".hsdsl-0123.part").write_text("half")
    cache.keep("kind", "other", ".txt", lambda target: open(target, "w").close())
    assert sorted(path.name for path in (folder / "kind").iterdir()) == ["key", "other"]


@needs_compiler
@posix
def test_without_a_folder_it_compiles_for_this_process(monkeypatch, tmp_path: Path, capsys) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    CompiledModel(hsdsl.load(MODELS[0]).program)
    assert "not kept" in capsys.readouterr().err


@needs_compiler
def test_processes_may_compile_the_same_at_once(with_loop) -> None:
    with_loop()
    command = [sys.executable, "-m", "hsdsl", "run", str(MODELS[0]), "--json", "--engine", "c", "--scheme", "relaxed"]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) for _ in range(3)]
    for process in running:
        _, errors = process.communicate()
        assert process.returncode == 0 and not errors, errors.decode()


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_a_program_seen_before_is_the_program(path: Path) -> None:
    first, second = hsdsl.load(path), None
    program = first.program
    second = hsdsl.load(path)
    assert "program" in second.pipeline.__dict__ and second.program == program
    assert second.columns == first.columns and repr(second) == repr(first)
    assert second.system.digest == first.system.digest


def test_a_run_seen_before_is_the_run(with_loop) -> None:
    with_loop()
    path = ROOT / "models" / "pronking-runner.yaml"
    first, second = hsdsl.load(path), hsdsl.load(path)
    assert alike(first.simulate(engine="python")) == alike(hsdsl.load(path).simulate(engine="python"))
    assert second.simulate(until="1/3", parameters={second.program.parameters[0]: "2/2"}).final.time == 1 / 3


def test_a_change_of_the_data_or_the_model_is_seen(tmp_path: Path) -> None:
    model, data = tmp_path / "m.yaml", tmp_path / "u.csv"
    model.write_text(WITH_DATA)
    finals = []
    for slope in (1, 1, 2):
        data.write_text(f"time,u\n0,{slope}\n1,{slope}\n")
        finals.append(hsdsl.load(model).simulate().final["x"])
    assert finals == pytest.approx([1, 1, 2])
    loaded = hsdsl.load(model)
    model.write_text(WITH_DATA.replace("x: 0", "x: 5"))
    data.unlink()
    assert loaded.simulate(until="1/2 + 1/4").final["x"] == pytest.approx(
        1.5
    )  # it is what was read, mathematics and all
    with pytest.raises(ModelError, match="no such file"):
        hsdsl.load(model)


def test_what_is_no_program_is_not_taken(folder: Path) -> None:
    path = MODELS[0]
    program = hsdsl.load(path).program
    written = ModelFiles.read(path).with_data({})
    assert program_cache.find(written) == (program, written)
    for changed in (
        replace(program, parameters=(1,)),
        replace(program, modes=None),
        replace(program, title=3),
        replace(program, digest=program.digest[::-1]),  # the program of other bytes
    ):
        for entry in (folder / program_cache.KIND / program_cache.key_of(written)).iterdir():
            entry.unlink()
        program_cache.keep(written, changed)  # type: ignore[arg-type]
        assert program_cache.find(written) is None


@needs_compiler
@pytest.mark.parametrize("program", [LIGHT, LIGHT_COMMAND], ids=["call", "command"])
def test_a_run_of_a_model_seen_before_imports_little(program: str, with_loop) -> None:
    with_loop()
    command = [sys.executable, "-c", program, str(ROOT / "models" / "oscillator-with-stop-2.yaml"), *HEAVY]
    lines = [subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines() for _ in range(2)]
    by_another_process = program == LIGHT_COMMAND  # see `hsdsl.engine.ahead`
    assert ("sympy" in lines[0][-1] or by_another_process) and lines[1][-1] == "[]"


PYTHON_LOOP = tuple(
    f"hsdsl.engine.simulate.{name}" for name in ("relaxed", "located", "entry", "zeno", "contact", "touching")
)
LOOKS = tuple(f"hsdsl.engine.simulate.verdict.{name}" for name in ("flows", "misses", "resets", "steps"))
OTHERS = (
    "hsdsl.analysis.report.summary",
    "hsdsl.language.elaborate",
    "hsdsl.mathematics.lower",
    "hsdsl.engine.backends.c",
)


@needs_compiler
@pytest.mark.parametrize(("name", "more"), [("thermostat", LOOKS), ("oscillator-with-stop-1", ())])
def test_a_run_of_a_model_seen_before_imports_no_loop_and_no_summary(
    name: str, more: tuple[str, ...], with_loop
) -> None:
    with_loop()
    unneeded = (*HEAVY, *PYTHON_LOOP, *OTHERS, *more)
    command = [sys.executable, "-c", LIGHT_COMMAND, str(ROOT / "models" / f"{name}.yaml"), *unneeded]
    lines = [subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines() for _ in range(2)]
    assert lines[0][-1] != "[]" and lines[1][-1] == "[]"


@needs_compiler
def test_the_runtime_is_compiled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    names = re.findall(r"\blibrary\.(hs_\w+)\.", inspect.getsource(kernel.runtime))
    symbol = library.LOOP[1]
    text = "".join(f'__attribute__((visibility("default"))) void {name}(void) {{}}\n' for name in {*names, symbol})
    monkeypatch.setattr(library, "LOOP", (text, symbol))  # which takes no seconds to compile
    kernel.runtime.cache_clear()
    assert kernel.runtime() is kernel.runtime() and library._kept(library._key(text, compiler.find_compiler()))
    kernel.runtime.cache_clear()


@needs_compiler
@pytest.mark.slow
def test_processes_that_begin_together_compile_once(tmp_path):
    log, compiler = tmp_path / "log", tmp_path / "cc"
    compiler.write_text(f'#!/bin/sh\necho "$*" >> {log}\nexec {shutil.which("cc") or shutil.which("gcc")} "$@"\n')
    compiler.chmod(0o755)
    environment = os.environ | {"CC": str(compiler), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    words = [sys.executable, "-m", "hsdsl", "run", str(ROOT / "models" / "bouncing-ball.yaml"), "-q", "--engine", "c"]
    begun = [subprocess.Popen(words, env=environment) for _ in range(2)]
    assert [process.wait() for process in begun] == [0, 0]
    libraries = [line for line in log.read_text().splitlines() if "-shared" in line]
    assert len(libraries) == 2  # the loop and the model
