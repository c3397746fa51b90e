"""Time boxes around symbolic work."""

import os
import subprocess
import sys
import threading
import time

import pytest

import hsdsl
from hsdsl.base import limits
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.base.limits import Limits, applied
from hsdsl.language.elaborate import elaborate
from hsdsl.language.expression import symbolic
from hsdsl.language.expression.timebox import OutOfTime, timebox
from hsdsl.mathematics.lower import lower

MODEL = b"""hsdsl: 1
modes: {A: {flow: {x: 1, v: sin(x)}}}
initial: {mode: A, x: 0, v: 0}
experiment: {until: 1}
"""


def busy(*_, **__):
    while True:
        sum(range(100))


def test_work_is_cut_short():
    began = time.process_time()
    with pytest.raises(OutOfTime), timebox(0.1):
        busy()
    assert time.process_time() - began < 2


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_work_is_cut_short_after_a_destructor_forgot_it():
    with pytest.raises(OutOfTime), timebox(0.1):
        Destroyed()  # Python forgets the first exception, in the destructor
        busy()


class Destroyed:
    def __del__(self):
        busy()


def test_each_part_has_its_own_time():
    with timebox(2.0, parts=4) as box:
        for _ in range(3):
            end = time.process_time() + 0.2
            while time.process_time() < end:
                pass
            box.restart()
    with pytest.raises(OutOfTime), timebox(2.0, parts=20):
        busy()


def test_the_whole_ends_at_the_next_part():
    with pytest.raises(OutOfTime), timebox(0.02) as box:
        while True:
            box.restart()


def test_it_works_in_any_thread():
    caught = []

    def work():
        try:
            with timebox(0.05):
                busy()
        except OutOfTime:
            caught.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join(20)
    assert caught == [True]


def test_nothing_arrives_afterwards():
    for _ in range(200):
        with timebox(5.0):
            pass
    end = time.process_time() + 0.05
    while time.process_time() < end:
        pass


def test_a_profiler_does_not_hang_after_a_box_that_ran_out():
    """CPython 3.11 looks for ever for an exception that was taken back."""
    program = (
        "import sys\n"
        "from hsdsl.language.expression.timebox import OutOfTime, timebox\n"
        "try:\n"
        "    with timebox(0.02):\n"
        "        while True: pass\n"
        "except OutOfTime: pass\n"
        "sys.setprofile(lambda *_: None)\n"
        "(lambda: 1)()\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


def test_an_expression_that_takes_too_long_is_an_error_at_its_place(monkeypatch):
    made = symbolic._made
    monkeypatch.setattr(
        symbolic, "_made", lambda tree, exprs: busy() if getattr(tree, "function", "") == "sin" else made(tree, exprs)
    )
    with pytest.raises(ModelError) as raised, applied(Limits(seconds=1.5)):
        elaborate("m.yaml", text=MODEL)
    (found,) = raised.value.diagnostics
    assert (found.code, found.span.line, found.span.column) == ("HS122", 2, 29)
    assert "--limit seconds" in found.hint


def test_lowering_that_takes_too_long_is_an_error(monkeypatch):
    system = elaborate("m.yaml", text=MODEL)
    monkeypatch.setattr("hsdsl.mathematics.lower.print_routines", busy)
    with pytest.raises(ModelError) as raised, applied(Limits(seconds=0.1)):
        lower(system)
    assert [d.code for d in raised.value.diagnostics] == ["HS122"]


def test_entries_and_values_and_bytes_are_capped(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_bytes(MODEL)
    for allowed, code in ((Limits(modes=2), "HS016"), (Limits(values=5), "HS015"), (Limits(bytes=50), "HS003")):
        with pytest.raises(ModelError) as raised:
            hsdsl.load(path, limits=allowed)
        (found,) = raised.value.diagnostics
        assert found.code == code
        assert "--limit" in found.hint
    hsdsl.load(path)


def test_data_lies_in_the_folder_of_the_model_or_where_it_may(tmp_path, command):
    (tmp_path / "models").mkdir()
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "u.csv").write_text("time,u\n0,1\n")
    (tmp_path / "models" / "linked.csv").symlink_to(tmp_path / "data" / "u.csv")
    path = tmp_path / "models" / "m.yaml"
    for name in ("../data/u.csv", str(tmp_path / "data" / "u.csv"), "linked.csv"):
        path.write_bytes(MODEL + f"inputs: {{u: {{file: {name}}}}}\n".encode())
        with pytest.raises(ModelError) as raised:
            hsdsl.load(path)
        assert [d.code for d in raised.value.diagnostics] == ["HS317"]
        hsdsl.load(path, limits=Limits(folders=(tmp_path / "data",)))
        assert command("validate", path).code == 1
        assert command("validate", path, "--allow-path", tmp_path / "data").code == 0
        assert command("run", path, "-q", "--engine", "python", "--allow-path", tmp_path / "data").code == 0


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "u.csv")
    with pytest.raises(ModelError) as raised:
        elaborate(tmp_path / "m.yaml", text=MODEL + b"inputs: {u: {file: u.csv}}\n")
    assert [d.code for d in raised.value.diagnostics] == ["HS311"]


def test_limits_on_the_command_line(tmp_path, command):
    path = tmp_path / "m.yaml"
    path.write_bytes(MODEL)
    assert command("validate", path, "--limit", "modes=2").code == 1
    assert command("validate", path, "--limit", "modes=1e5", "--limit", "seconds=inf").code == 0
    for wrong in (["--limit", "mods=3"], ["--limit", "modes=many"], ["--limit", "modes=-1"], ["--limit", "modes"]):
        answer = command("validate", path, *wrong)
        assert answer.code == 2 and "hsdsl: " in answer.err, wrong
    assert command("run", path, "--json", "--limit", "modes=x").json["errors"][0]["message"]
    assert command("run", path, "--allow-path", tmp_path / "nowhere").code == 2


def test_limits_are_positive():
    with pytest.raises(UsageError):
        Limits(seconds=0)
    assert limits.current() == limits.DEFAULT
