"""Streamed runs: the rows that a kept run has, in constant memory, readable at any end."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from engines import needs_compiler
from shipped import MODELS

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.engine.simulate import output_buffers

CASES = Path(__file__).parents[1] / "conformance" / "cases"
OSCILLATOR = MODELS / "oscillator-with-stop-1.yaml"
LONG = {"scheme": "relaxed", "method": "midpoint", "max_transitions": 10**9}


def table(path):
    with path.open() as file:
        return list(csv.reader(file))


@needs_compiler
@pytest.mark.parametrize("every", [1, 7, 10**9])
@pytest.mark.parametrize("rows", [13, 2048])
@pytest.mark.parametrize(
    "path",
    [OSCILLATOR, CASES / "dimensions.yaml", CASES / "outputs.yaml", CASES / "m10-final.yaml"],
    ids=lambda p: p.stem,
)
def test_rows_are_those_of_a_kept_run(path, rows, every, tmp_path, monkeypatch):
    monkeypatch.setattr(output_buffers, "LEAST_ROWS", rows)
    model, given = (
        hsdsl.load(path),
        {"scheme": "relaxed", "method": "rk4", "step": "0.0171", "relaxation": 1e-3, "until": 8},
    )
    streamed = model.stream(tmp_path / "run.csv", every=every, **given)
    kept = model.simulate(**given)
    assert (streamed.stop, streamed.transitions, streamed.steps) == (kept.stop, len(kept.transitions), len(kept.times))
    jump_of = [arc.jump for arc in kept.arcs for _ in range(arc.first, arc.last + 1)]
    last = len(jump_of) - 1
    at_jump = {side for k in range(last) if jump_of[k] != jump_of[k + 1] for side in (k, k + 1)}
    due = [k for k in range(last + 1) if k % every == 0 or k == last or k in at_jump]
    written = table(tmp_path / "run.csv")
    assert len(written) - 1 == len(due) == streamed.rows
    arc_of = [arc for arc in kept.arcs for _ in range(arc.first, arc.last + 1)]
    for line, k in zip(written[1:], due, strict=True):
        cells, arc = dict(zip(written[0], line, strict=True)), arc_of[k]
        assert (float(cells["time"]), cells["mode"], int(cells["j"])) == (kept.times[k], arc.mode, arc.jump)
        assert [float(cells[name]) for name in arc.states] == kept.values[k, : len(arc.states)].tolist()
        for name, value in zip(kept.output_names, kept.outputs[k].tolist(), strict=True):
            assert float(cells[name] or "nan") == value or value != value
    assert float(streamed.final.time[0]) == kept.final.time and str(streamed.final.mode[0]) == kept.final.mode


@needs_compiler
def test_what_a_killed_run_has_written_is_whole(tmp_path):
    out = tmp_path / "run.csv"
    command = (
        f"import hsdsl; hsdsl.load({str(OSCILLATOR)!r}).stream({str(out)!r}, every=100, until=1e7, step=1e-3, **{LONG})"
    )
    process = subprocess.Popen([sys.executable, "-c", command])
    try:
        for _ in range(600):
            if out.exists() and out.stat().st_size > 50_000:
                break
            time.sleep(0.1)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert out.read_bytes().endswith(b"\n")
    rows = table(out)
    assert len(rows) > 100 and {len(row) for row in rows} == {5}
    times = [float(row[0]) for row in rows[1:]]
    assert times == sorted(times)
    samples = [hsdsl.load(OSCILLATOR).simulate(until=times[40] + 1, step=1e-3, **LONG)(t) for t in times[1:40:13]]
    assert [float(row[3]) for row in rows[2:41:13]] == [s["x"] for s in samples]


@needs_compiler
def test_columns_and_refusals(tmp_path):
    model = hsdsl.load(OSCILLATOR)
    model.stream(tmp_path / "v.csv", columns=["v"], until=1)
    assert table(tmp_path / "v.csv")[0] == ["time", "mode", "j", "v"]
    for arguments, sentence in (
        ({"path": "run.npz"}, "should end in .csv"),
        ({"path": tmp_path / "none" / "run.csv"}, r"cannot write .*: No such file"),
        ({"every": 0}, "every must be at least 1"),
        ({"columns": ["w"]}, "no state or output is called w"),
        ({"engine": "python"}, "only the compiled engine streams"),
        ({"precision": 50}, "a streamed run has no argument 'precision'"),
    ):
        with pytest.raises(UsageError, match=sentence):
            model.stream(**{"path": tmp_path / "run.csv", **arguments})


@needs_compiler
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is full")
def test_a_full_disk_ends_in_a_sentence(tmp_path):
    (tmp_path / "full.csv").symlink_to("/dev/full")
    with pytest.raises(UsageError, match=r"cannot write .*full\.csv: No space left on device"):
        hsdsl.load(OSCILLATOR).stream(tmp_path / "full.csv", until=100)


def test_without_a_compiler_it_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "/no/such/compiler")
    with pytest.raises(UsageError, match="engine 'c' cannot run this"):
        hsdsl.load(OSCILLATOR).stream(tmp_path / "run.csv")


@needs_compiler
def test_the_command_line_streams(tmp_path, capsys, monkeypatch):
    from hsdsl.interface.cli import main

    out = tmp_path / "run.csv"
    arguments = ["hsdsl", "run", str(OSCILLATOR), "--until", "3", "--out", str(out), "--every", "50", "--json"]
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as ended:
        main()
    printed = json.loads(capsys.readouterr().out)
    assert not ended.value.code and printed["out"]["rows"] == len(table(out)) - 1 and printed["transition_count"] == 2
    assert printed["final"]["time"] == 3 and list(printed["final"]["state"]) == ["x", "v"]


GROWTH = """
import resource, sys, hsdsl
model, rss = hsdsl.load(sys.argv[1]), []
for until in (10, 100, 2000):
    run = model.stream(sys.argv[2], every=1000, until=until, step=1e-3, scheme="relaxed", method="midpoint")
    rss.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
assert run.steps > 2e6
print(rss[2] - rss[0])
"""


@needs_compiler
@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is counted in other units elsewhere")
def test_memory_stays_flat(tmp_path):
    command = [sys.executable, "-c", GROWTH, str(OSCILLATOR), str(tmp_path / "run.csv")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert int(done.stdout) < 2000  # kilobytes; the rows alone would be 200 megabytes
