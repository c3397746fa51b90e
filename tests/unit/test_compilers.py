"""Compilers that are missing, fail, hang or lie: the Python engine runs with one remark, engine c is refused."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from engines import needs_compiler

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.base.limits import Limits
from hsdsl.engine.preparation import pipeline
from hsdsl.engine.runtime import compiler, kernel, library, process
from hsdsl.interface.cli.verbs import obey

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the compilers here are shell scripts")
MODEL = Path(__file__).parents[2] / "models" / "thermostat.yaml"
PUT = 'while [ "$1" != "-o" ]; do shift; done\n'  # what is made goes to $2
FAULTY = {
    "fails": ("exit 1", "exit code 1"),
    "complains": ('echo "model.c:1: error: no such thing" >&2; exit 1', "no such thing"),
    "says much": ("head -c 30000000 /dev/zero | tr '\\0' e >&2; exit 1", "failed"),
    "is killed": ("kill -SEGV $$", "signal 11"),
    "makes nothing": ("exit 0", "made no library"),
    "makes rubbish": (PUT + 'echo rubbish > "$2"', "cannot be loaded"),
    "makes a folder": (PUT + 'mkdir "$2"', "made no library"),
    "makes another library": (
        PUT + f'echo | {shutil.which("cc") or "cc"} -shared -x c - -o "$2"',
        "has no hs_the_model",
    ),
    "has no interpreter": ("#!/no/such/interpreter", "cannot be run"),
    "waits": ("sleep 600", "does not end"),
    "waits in a child": ("trap '' TERM HUP INT\nsleep 600 & wait", "does not end"),
    "computes for ever": ("while :; do :; done", "does not end"),
}
WRONG = {
    "/no/such/compiler": "is no command here",
    "'gcc": "quotation mark",
    'gcc "-O1': "quotation mark",
    "/": "is no command here",
    "no-such-compiler -m32 'a b'": "is no command here",
}


@pytest.fixture(autouse=True)
def nothing_known(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Nothing is compiled, nothing has been printed, and a compiler has the fifth of a second."""
    kernel.runtime.cache_clear()
    monkeypatch.setattr(process, "FIRST_WAIT", 0.2)
    monkeypatch.setattr(compiler, "TRIAL", 60.0)  # what compiles may take long where much else runs
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    pipeline._warn_once.cache_clear()
    library._say_unkept.cache_clear()


@pytest.fixture
def use(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """Write a compiler and name it in CC."""

    def written(script: str) -> Path:
        path = tmp_path / "faulty-cc"
        path.write_text(script if script.startswith("#!") else f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)
        monkeypatch.setenv("CC", str(path))
        return path

    return written


def assert_python_runs_with_one_remark(printed: str, capsys: pytest.CaptureFixture[str]) -> None:
    model = hsdsl.load(MODEL)
    assert [model.simulate(until=until).engine for until in (0.1, 0.2)] == ["python"] * 2
    assert hsdsl.load(MODEL).simulate().engine == "python"
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and printed in error and "Traceback" not in error, error
    with pytest.raises(UsageError, match="engine 'c' cannot run this"):
        model.simulate(engine="c")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("fault", FAULTY)
def test_a_faulty_compiler(fault: str, use, capsys, monkeypatch, tmp_path: Path) -> None:
    script, printed = FAULTY[fault]
    if printed == "does not end":
        monkeypatch.setattr(compiler, "TRIAL", 0.3)
    use(script)
    assert_python_runs_with_one_remark(printed, capsys)
    assert not [path for path in tmp_path.iterdir() if path.name.startswith("hsdsl-")]
    assert not list((tmp_path / "cache").rglob("*.so"))


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_name(text: str, monkeypatch, capsys) -> None:
    monkeypatch.setenv("CC", text)
    assert_python_runs_with_one_remark(WRONG[text], capsys)


def test_a_file_that_is_no_program(use, capsys) -> None:
    use("exit 1").chmod(0o644)
    assert_python_runs_with_one_remark("is no command here", capsys)


def test_all_that_a_compiler_started_ends_with_it(use, monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setattr(compiler, "TRIAL", 0.3)
    use(f"sleep 600 & echo $! >> {tmp_path}/children; wait")
    assert hsdsl.load(MODEL).simulate().engine == "python"
    for child in (tmp_path / "children").read_text().split():
        for _ in range(200):
            if not Path(f"/proc/{child}").exists() or " Z " in Path(f"/proc/{child}/stat").read_text():
                break
            time.sleep(0.05)
        else:
            pytest.fail(f"{child} is still running")


@needs_compiler
def test_arguments_and_blanks_in_cc(with_loop, monkeypatch, tmp_path: Path) -> None:
    folder = tmp_path / "my tools"
    folder.mkdir()
    real = shutil.which(" ".join(compiler.find_compiler().command))
    (folder / "my cc").symlink_to(str(real))
    for text in (str(folder / "my cc"), f"'{folder}/my cc' -O1 '-DA=\"a b\"'"):
        monkeypatch.setenv("CC", text)
        with_loop()
        assert hsdsl.load(MODEL).simulate(until=0.1).engine == "c"


@needs_compiler
def test_a_compiler_that_is_only_slow_is_waited_for(use, with_loop, monkeypatch) -> None:
    real = compiler.find_compiler().command[0]
    monkeypatch.setattr(process, "FIRST_WAIT", 0.4)
    use(f'case "$*" in *model.c*) sleep 1;; esac\nexec {real} "$@"')
    with_loop()
    assert hsdsl.load(MODEL).simulate(until=0.1).engine == "c"


@needs_compiler
def test_a_compiler_has_so_much_time(use, capsys) -> None:
    real = compiler.find_compiler().command[0]
    use(f'case "$*" in *model.c*) sleep 600;; esac\nexec {real} "$@"')
    assert hsdsl.load(MODEL, limits=Limits(compile=0.5)).simulate(until=0.1).engine == "python"
    printed = capsys.readouterr().err
    assert "--limit compile=5 " in printed and "the longest expression is the flow of T in mode" in printed


@needs_compiler
def test_what_takes_too_long_is_tried_once(use, with_loop, capsys, tmp_path: Path) -> None:
    """It is tried again with more time, by another compiler, and where it is to be forgotten."""
    real, tried = compiler.find_compiler().command[0], tmp_path / "tried"
    slow = f'if grep -qs hs_the_model -- "$@"; then echo once >> {tried}; sleep 600; fi\nexec {real} "$@"'
    use(slow)

    def runs(seconds: float) -> int:
        """How often the compiler has been tried, after another run."""
        pipeline._warn_once.cache_clear()
        with_loop()
        assert hsdsl.load(MODEL, limits=Limits(compile=seconds)).simulate(until=0.1).engine == "python"
        return len(tried.read_text().split())

    assert [runs(0.6), runs(0.6), runs(0.5), runs(0.7), runs(0.6)] == [1, 1, 1, 2, 2]
    printed = capsys.readouterr().err.splitlines()
    assert len(printed) == 5 and "took more than 0.6 s before" in printed[1]
    assert "--limit compile=6 " in printed[1] and "hsdsl doctor --forget" in printed[1]
    assert obey(["doctor", "--json"]) == 0
    assert '"given_up": 1' in capsys.readouterr().out
    assert obey(["doctor", "--forget"]) == 0
    assert runs(0.6) == 3
    use(slow + "\n# another one")
    assert runs(0.6) == 4


@needs_compiler
def test_a_compiler_that_fails_for_the_runtime_alone(use, capsys) -> None:
    real = compiler.find_compiler().command[0]
    use(f'grep -qsF library.c "$TMPDIR"/model.c && exit 1\nexec {real} "$@"')
    assert_python_runs_with_one_remark("exit code 1", capsys)


@needs_compiler
def test_a_full_folder_for_temporary_files(monkeypatch, capsys, tmp_path: Path) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    assert_python_runs_with_one_remark("No space left on device", capsys)


@needs_compiler
def test_nothing_is_left_where_the_process_ends_first(use, tmp_path: Path) -> None:
    """A model with errors is refused while another thread compiles: neither process nor folder outlives that."""
    import subprocess

    use(f"echo $$ >> {tmp_path}/pids; sleep 600")
    model = tmp_path / "wrong.yaml"
    model.write_text(MODEL.read_text().replace("low", "lo"))
    done = subprocess.run([sys.executable, "-m", "hsdsl", "run", str(model)], capture_output=True, text=True)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    pids = (tmp_path / "pids").read_text().split() if (tmp_path / "pids").exists() else []
    assert not [pid for pid in pids if Path(f"/proc/{pid}").exists()]
    assert not [path for path in tmp_path.iterdir() if path.name.startswith("hsdsl-")]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="nobody else says how long a process had a processor")
def test_time_of_other_programs_does_not_count(tmp_path: Path) -> None:
    """A program that must use its processor time gets it, also behind another one and beside one with any name."""
    odd = os.fsencode(tmp_path) + b"/\xff"
    shutil.copy("/bin/sleep", odd)
    works = [sys.executable, "-c", "import time\nwhile time.process_time() < 0.35: pass"]
    waits = [sys.executable, "-c", "import time; time.sleep(1e6)"]
    endless = [sys.executable, "-c", "while True: pass"]
    with subprocess.Popen([odd, b"1e6"]) as other:
        ends = process.run([works, works, works, works, waits, endless], tmp_path, 0.5, lambda: True)
        other.kill()
    assert [code for code, _ in ends] == [0, 0, 0, 0, None, None]
