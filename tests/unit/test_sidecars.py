"""A table and its sidecar: whatever breaks and whoever else writes, a sidecar that is there is that of its table."""

from __future__ import annotations

import errno
import json
import os
import threading
from pathlib import Path

import hand_made
import pytest
from engines import needs_compiler

import hsdsl
from hsdsl.analysis import store
from hsdsl.analysis.store import read_sidecar
from hsdsl.base.errors import UsageError

BALL = Path(__file__).parents[2] / "models" / "bouncing-ball.yaml"
RUNS = [hand_made.jumping_input(), hand_made.modes_of_different_size(), hand_made.ends_in_strip()]
STEPS = ("open", "fsync", "chmod", "unlink", "replace")  # what saving does to the file system, all through `os`
MOST = 40  # more steps than saving takes


@pytest.fixture(scope="module")
def agree(tmp_path_factory):
    """Tell whether a table is whole and its sidecar, if it has one, its own."""
    folder, wholes = tmp_path_factory.mktemp("wholes"), {}
    for run in RUNS:
        for suffix in (".csv", ".parquet"):
            table, _ = run.save(folder / f"run{suffix}")
            wholes[table.read_bytes()] = run

    def check(path: Path) -> bool:
        run = wholes[path.read_bytes()]
        if not path.with_name(path.name + ".json").exists():
            return True
        return read_sidecar(path)["stop"]["message"] == run.stop.message

    assert len(wholes) == 6 and len({run.stop.message for run in RUNS}) == 3
    return check


def counted(monkeypatch: pytest.MonkeyPatch, fatal: int, die) -> list[int]:
    """Let the step with this number not happen, and ``die`` in its place. Returns where it says that it did."""
    made, died = iter(range(10**9)), []
    for step in STEPS:
        original = getattr(os, step)

        def instead(*arguments, original=original, **named):
            if next(made) == fatal:
                died.append(fatal)
                die()
            return original(*arguments, **named)

        monkeypatch.setattr(os, step, instead)
    return died


def _disk_full() -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _interrupted() -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("die", [_disk_full, _interrupted])
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_failure_at_any_step_leaves_what_belongs_together(die, suffix, agree, tmp_path, monkeypatch):
    path, failures = tmp_path / f"run{suffix}", 0
    for fatal in range(MOST):
        RUNS[0].save(path)
        with monkeypatch.context() as patched:
            died = counted(patched, fatal, die)
            try:
                RUNS[1].save(path)
            except (UsageError, KeyboardInterrupt):
                failures += 1
        assert agree(path), fatal
        if not died:  # all steps were made
            break
    assert 8 <= failures < MOST


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_process_killed_at_any_step_leaves_what_belongs_together(suffix, agree, tmp_path, monkeypatch):
    path, killed = tmp_path / f"run{suffix}", 0
    for fatal in range(MOST):
        RUNS[0].save(path)
        child = os.fork()
        if child == 0:
            counted(monkeypatch, fatal, lambda: os._exit(1))
            RUNS[1].save(path)
            os._exit(0)
        killed += os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        assert agree(path), fatal
        if killed == fatal:
            break
    assert 8 <= killed < MOST


def test_many_who_save_under_one_name_leave_one_of_theirs(agree, tmp_path):
    path, wrong = tmp_path / "run.csv", []
    RUNS[0].save(path)

    def work(run) -> None:
        try:
            for _ in range(200):
                run.save(path)
        except BaseException as error:
            wrong.append(error)

    threads = [threading.Thread(target=work, args=[run]) for run in RUNS]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120)
    assert not wrong and not any(thread.is_alive() for thread in threads)
    assert (tmp_path / "run.csv.json").exists() and agree(path)
    assert sorted(p.name for p in tmp_path.iterdir() if p.suffix == ".part") == []


@needs_compiler
def test_a_stream_removes_the_sidecar_of_what_it_writes_over(tmp_path):
    RUNS[0].save(tmp_path / "run.csv")
    model = hsdsl.load(BALL)
    model.stream(tmp_path / "run.csv", until=1)
    assert [p.name for p in tmp_path.iterdir()] == ["run.csv"]
    (tmp_path / "run.csv.json").write_text('{"mine": 1}')
    model.stream(tmp_path / "run.csv", until=1)
    assert (tmp_path / "run.csv.json").read_text() == '{"mine": 1}'


def _without(path: Path) -> None:
    path.with_name("run.csv.json").unlink()


def _longer(path: Path) -> None:
    with path.open("a") as file:
        file.write("9,a,0,1,2\n")


def _other(path: Path) -> None:
    path.write_text("time\n0\n")


def _halved(path: Path) -> None:
    beside = path.with_name("run.csv.json")
    beside.write_bytes(beside.read_bytes()[:50])


def _deep(path: Path) -> None:
    path.with_name("run.csv.json").write_text("[" * 100_000)


@pytest.mark.parametrize("change", [_without, _longer, _other, _halved, _deep, Path.unlink])
def test_what_does_not_belong_together_is_not_read(change, agree, tmp_path):
    path = tmp_path / "run.csv"
    RUNS[1].save(path)
    assert read_sidecar(path)["table"]["rows"] == 7 and agree(path)
    change(path)
    with pytest.raises(UsageError, match=r"does not belong|damaged|No such file"):
        read_sidecar(path)


def test_a_table_that_was_moved_with_its_sidecar_still_belongs_to_it(tmp_path):
    RUNS[1].save(tmp_path / "run.csv")
    (tmp_path / "run.csv").rename(tmp_path / "other.csv")
    (tmp_path / "run.csv.json").rename(tmp_path / "other.csv.json")
    assert read_sidecar(tmp_path / "other.csv")["table"]["file"] == "run.csv"


def test_a_chart_removes_the_sidecar_of_what_it_writes_over(tmp_path, monkeypatch):
    from hsdsl.interface.cli import charts
    from hsdsl.interface.cli.options import Answer

    RUNS[0].save(tmp_path / "run.csv")
    monkeypatch.setattr("hsdsl.interface.chart.rows.as_csv", lambda rows: "name\n")
    charts._report([], tmp_path / "run.csv", None, Answer(quiet=True))
    assert [p.name for p in tmp_path.iterdir()] == ["run.csv"]
    with pytest.raises(UsageError, match="No such file"):
        read_sidecar(tmp_path / "run.csv")
    store.forget_sidecar(tmp_path / "run.csv")
    (tmp_path / "run.csv.json").write_text(json.dumps({"table": 3, "versions": {}}))
    store.forget_sidecar(tmp_path / "run.csv")
    assert (tmp_path / "run.csv.json").exists()
