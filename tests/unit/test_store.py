"""Executions in files and back."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import re
import stat
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import hand_made
import numpy as np
import pytest

import hsdsl.analysis.store.table
from hsdsl.analysis import store
from hsdsl.base.atomic import replacing
from hsdsl.base.errors import UsageError
from hsdsl.base.numbers import decimals

FIFTY = decimals.context_of(50)


def fifty_digits():
    return hand_made.bouncing_ball(convert=FIFTY.mpf, digits=50, restitution="0.8", wait="0.1")


def odd_settings():
    """Every kind of value that a setting may have."""
    settings = {
        "until": 1.5,
        "set": {"initial.x": 2, "p": float("inf"), "q": -0.0},
        "samples": (0.1, 0.2),
        "names": ["a", "b"],
        "$odd": None,
        "flag": True,
        "scalar": np.float64(0.1),
    }
    return replace(hand_made.ends_in_strip(), settings=settings)


@pytest.mark.parametrize("make", [*hand_made.EVERY, fifty_digits, odd_settings])
def test_npz_loses_nothing(make, tmp_path):
    run = make()
    assert run.save(tmp_path / "run.npz") == (tmp_path / "run.npz",)
    again = store.load(tmp_path / "run.npz")
    assert again == run
    assert [type(x) for x in again.settings.values()] == [
        float if type(x) is np.float64 else type(x) for x in run.settings.values()
    ]


@pytest.mark.parametrize("digits", [16, 50, 200])
def test_npz_keeps_every_bit_of_hard_numbers(digits, tmp_path):
    context = decimals.context_of(digits)
    third, tiny, huge = context.mpf(1) / 3, context.mpf(2) ** -3000 / 7, context.mpf(10) ** 400 / 3
    draft = hand_made.Draft(("o",), degree=1)
    draft.arc("m", ("x",), 0, [(third, [tiny], [context.nan], context.mpf(0), [[huge]]),
                               (context.mpf(1), [-huge], [context.inf], context.mpf(0), [])])  # fmt: skip
    run = draft.make(digits=digits)
    run.save(tmp_path / "run.npz")
    again = store.load(tmp_path / "run.npz")
    assert again == run
    assert [x._mpf_ for x in again.values[:, 0]] == [tiny._mpf_, (-huge)._mpf_]
    assert again(third)["x"] + third == tiny + third  # numbers of the run's own context: they go on computing alike


def test_npz_holds_no_pickle(tmp_path):
    fifty_digits().save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz", allow_pickle=False) as archive:
        assert {archive[name].dtype.kind for name in archive.files} <= set("fiuS")


def _truncated(path):
    path.write_bytes(path.read_bytes()[:-200])


def _flipped(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)


def _foreign(path):
    np.savez(path, x=np.zeros(3))


def _with_header(path, text):
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    np.savez(path, **arrays | {"header": np.frombuffer(text(json.loads(arrays["header"].tobytes())), dtype=np.uint8)})


def _saying(**changed):
    return lambda path: _with_header(path, lambda header: json.dumps(header | changed).encode())


def _compressed(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.npy", b"0" * 10_000_000)


def _array_header(text):
    """A column whose NumPy header says something that its parser stumbles over."""

    def change(path):
        with zipfile.ZipFile(path) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        head = text.encode()
        members["times.npy"] = b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head
        with zipfile.ZipFile(path, "w") as archive:
            for name, content in members.items():
                archive.writestr(name, content)

    return change


def _pickled(path):
    np.savez(path, header=np.array([{"evil": 1}], dtype=object))


def _mismatched(path):
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    np.savez(path, **arrays | {"times": arrays["times"][:-1]})


def _no_number(path):
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    np.savez(path, **arrays | {"times": np.array([b"one"] * len(arrays["times"]))})


DAMAGES = [
    _truncated, _flipped, _foreign, _pickled, _mismatched, _no_number, _compressed,
    _array_header("{'descr': '<f8', 'shape': (3,"), _array_header("(" * 9_000), _array_header("1L"), _array_header('"'),
    lambda path: _with_header(path, lambda _: b"[" * 200_000), lambda path: _with_header(path, lambda _: b"9" * 5_000),
    lambda path: _with_header(path, lambda header: json.dumps([header]).encode()),
    _saying(version=0), _saying(version="2"), _saying(version=None), _saying(format="other"), _saying(bits="x"),
    _saying(model=3), _saying(title=["<b>"]), _saying(digits=-5), _saying(settings=[]), _saying(seconds={"load": "x"}),
    _saying(stop={"reason": "until", "time": "x", "message": ""}), _saying(transitions=[{"index": "<b>"}]),
    _saying(final={}), _saying(layouts=[]), _saying(output_names={"$tuple": [1]}), _saying(settings={"left_out": {}}),
    lambda path: path.write_bytes(b""), lambda path: path.write_text("time,mode,j\n"),
    lambda path: zipfile.ZipFile(path, "w").close(),
]  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_file_that_holds_no_execution_is_refused(damage, tmp_path):
    path = tmp_path / "run.npz"
    fifty_digits().save(path)
    damage(path)
    with pytest.raises(UsageError, match="damaged, or not an execution"):
        store.load(path)


def test_a_file_of_a_later_version_says_so(tmp_path):
    path = tmp_path / "run.npz"
    fifty_digits().save(path)
    for change in ({"version": 2}, {"version": 7, "model": {"new": "form"}, "stop": None}):
        _saying(**change)(path)
        with pytest.raises(UsageError, match=f"in format {change['version']}; this one reads 1") as caught:
            store.load(path)
        assert caught.value.hint == "update hsdsl" and "damaged" not in str(caught.value)


def test_a_file_that_needs_more_memory_than_there_is_says_so(tmp_path):
    path = tmp_path / "run.npz"
    hand_made.jumping_input().save(path)
    _array_header("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999,), }\n")(path)
    with pytest.raises(UsageError, match=r"does not fit into memory|damaged"):
        store.load(path)


@pytest.mark.parametrize("make", [fifty_digits, hand_made.modes_of_different_size])
def test_a_file_cut_short_or_changed_anywhere_gives_the_run_or_one_error(make, tmp_path):
    path, run = tmp_path / "run.npz", make()
    run.save(path)
    whole, random = path.read_bytes(), np.random.default_rng(7)
    broken = [whole[:length] for length in {*range(0, len(whole), 97), *range(len(whole) - 300, len(whole))}]
    for place in random.integers(0, len(whole), 400).tolist():
        broken.append(whole[:place] + bytes([whole[place] ^ int(random.integers(1, 256))]) + whole[place + 1 :])
    same = 0
    for content in broken:
        path.write_bytes(content)
        try:
            same += store.load(path) == run or pytest.fail("another run")
        except UsageError as error:
            assert re.fullmatch(r"cannot read \S+run\.npz: [^\n]+", str(error))
    assert same < len(broken) / 3  # only what says nothing, such as a date, can be changed


@pytest.mark.parametrize("make", [os.mkfifo, Path.mkdir, lambda path: path.symlink_to("/dev/zero")])
def test_what_is_no_regular_file_is_no_run(make, tmp_path):
    make(tmp_path / "run.npz")
    with pytest.raises(UsageError, match=r"not a regular file|[Ii]s a directory"):
        store.load(tmp_path / "run.npz")


def test_a_file_that_cannot_be_opened_is_refused(tmp_path):
    with pytest.raises(UsageError, match="No such file"):
        store.load(tmp_path / "none.npz")
    with pytest.raises(UsageError, match="only those hold a whole execution"):
        store.load(tmp_path / "run.csv")


def test_csv_to_the_letter(tmp_path):
    run = hand_made.modes_of_different_size()
    assert run.save(tmp_path / "run.csv") == (tmp_path / "run.csv", tmp_path / "run.csv.json")
    assert (tmp_path / "run.csv").read_text() == (
        "time,mode,j,x,y,z,w,double\n"
        "0.0,a,0,0.0,10.0,,,\n"
        "1.0,a,0,1.0,9.0,,,\n"
        "1.0,b,1,1.0,9.0,5.0,,10.0\n"
        "1.0,c,2,,,6.0,,12.0\n"
        "1.0,a,3,7.0,8.0,,,\n"
        "3.0,a,3,9.0,6.0,,,\n"
        "3.0,end,4,,6.0,,-1.0,\n"
    )


def _read(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


def test_csv_numbers_read_back_exactly(tmp_path):
    run = hand_made.bouncing_ball(restitution="0.9", height=1 / 3, pieces=3)
    run.save(tmp_path / "run.csv")
    _, *rows = _read(tmp_path / "run.csv")
    expected = run.rows()
    assert [float(row[0]) for row in rows] == expected.time.tolist()
    assert [float(row[3]) for row in rows] == expected["h"].tolist()


def test_csv_tells_not_a_number_from_no_state(tmp_path):
    hand_made.blow_up().save(tmp_path / "run.csv")
    assert _read(tmp_path / "run.csv")[-1] == ["1.0", "m", "0", "inf", "nan"]


def test_csv_tells_zeros_of_both_signs_that_follow_each_other(tmp_path):
    draft, values = hand_made.Draft(), [0.0, -0.0, -0.0, hand_made.NAN, hand_made.NAN, 0.0, 0.1, 0.1]
    draft.arc("m", ("x",), 0, [(float(k), [value], [], 0.0, []) for k, value in enumerate(values)])
    draft.make().save(tmp_path / "run.csv")
    assert [row[3] for row in _read(tmp_path / "run.csv")[1:]] == list(map(repr, values))


def test_csv_writes_every_digit(tmp_path):
    run = fifty_digits()
    run.save(tmp_path / "run.csv")
    _, *rows = _read(tmp_path / "run.csv")
    precision = decimals.bits(run.rows().time)
    assert [decimals.read(row[0], precision, FIFTY) for row in rows] == run.rows().time.tolist()
    assert max(len(row[0]) for row in rows) > 50


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_awkward_names(suffix, tmp_path):
    draft = hand_made.Draft(("time",))
    rows = [(0.0, [1.0, 2.0], [3.0], 0.0, [])]
    draft.arc('größe, "quoted"\nmode', ("j", "λ"), 0, rows)
    run = draft.make()
    path = tmp_path / f"run{suffix}"
    run.save(path)
    header = ["time", "mode", "j", "state.j", "λ", "output.time"]
    row = [0.0, 'größe, "quoted"\nmode', 0, 1.0, 2.0, 3.0]
    if suffix == ".csv":
        assert _read(path) == [header, [str(x) for x in row]]
    else:
        import pyarrow.parquet

        table = pyarrow.parquet.read_table(path)
        assert table.column_names == header
        assert list(table.to_pylist()[0].values()) == row


def test_parquet_has_nulls_where_csv_is_empty(tmp_path):
    import pyarrow.parquet

    hand_made.modes_of_different_size().save(tmp_path / "run.parquet")
    table = pyarrow.parquet.read_table(tmp_path / "run.parquet")
    assert table.column_names == ["time", "mode", "j", "x", "y", "z", "w", "double"]
    assert table["z"].to_pylist() == [None, None, 5.0, 6.0, None, None, None]
    assert table["double"].to_pylist() == [None, None, 10.0, 12.0, None, None, None]
    hand_made.blow_up().save(tmp_path / "run.parquet")
    last = pyarrow.parquet.read_table(tmp_path / "run.parquet")["y"].to_pylist()[-1]
    assert last is not None and np.isnan(last)


def test_parquet_of_fifty_digits_is_text(tmp_path):
    import pyarrow.parquet

    run = fifty_digits()
    run.save(tmp_path / "run.parquet")
    run.save(tmp_path / "run.csv")
    table = pyarrow.parquet.read_table(tmp_path / "run.parquet")
    assert table["h"].to_pylist() == [row[3] for row in _read(tmp_path / "run.csv")[1:]]


@pytest.mark.parametrize(("suffix", "library"), [(".parquet", "pyarrow")])
def test_a_missing_library_is_named_and_nothing_is_written(suffix, library, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(UsageError, match=r"needs pyarrow, which is not installed: pip install 'hsdsl\[table\]'"):
        hand_made.jumping_input().save(tmp_path / f"run{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("library", ["pandas", "pyarrow"])
def test_csv_and_npz_need_no_table_library(library, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    for suffix in (".csv", ".npz"):
        hand_made.jumping_input().save(tmp_path / f"run{suffix}")


def test_sidecar(tmp_path):
    run = hand_made.modes_of_different_size()
    run.save(tmp_path / "run.csv")
    sidecar = json.loads((tmp_path / "run.csv.json").read_text())
    assert sidecar["model"] == run.model
    assert sidecar["sha256"] == run.digest
    assert sidecar["settings"] == run.settings
    assert sidecar["table"] == {"file": "run.csv", "rows": 7, "columns": list(run.rows().labels)}
    assert {"python", "hsdsl", "numpy", "mpmath", "sympy"} == set(sidecar["versions"])
    assert sidecar["stop"] == {"reason": "final", "time": 3.0, "message": "The run entered the final mode end."}
    assert [t["edge"] for t in sidecar["transitions"]] == ["a->b", "b->c", "c->a", "a->end"]
    assert sidecar["verdict"]["theorem"] == "unknown"


def test_rows_at_samples_and_both_rows_of_each_jump(tmp_path):
    run = hand_made.modes_of_different_size()
    run.save(tmp_path / "run.csv", samples=[2.5, 0.5, 1.0, 99.0, -1.0])
    rows = _read(tmp_path / "run.csv")[1:]
    assert [(row[0], row[1], row[2]) for row in rows] == [
        ("0.5", "a", "0"),
        ("1.0", "a", "0"),
        ("1.0", "b", "1"),
        ("1.0", "c", "2"),
        ("1.0", "a", "3"),
        ("2.5", "a", "3"),
        ("3.0", "a", "3"),
        ("3.0", "end", "4"),
    ]
    assert json.loads((tmp_path / "run.csv.json").read_text())["table"]["rows"] == 8


@pytest.mark.parametrize(
    ("samples", "jumps", "expected"),
    [
        ([0.5, 1.0, 2.5], "none", [("0.5", "0"), ("1.0", "3"), ("2.5", "3")]),
        ([0.5, 2.5], "after", [("0.5", "0"), ("1.0", "3"), ("2.5", "3"), ("3.0", "4")]),
        (None, "after", [("0.0", "0"), ("1.0", "3"), ("3.0", "4")]),
    ],
)
def test_jumps_have_one_row_or_none(samples, jumps, expected, tmp_path):
    """Three transitions at t = 1 and one at t = 3, the end."""
    hand_made.modes_of_different_size().save(tmp_path / "run.csv", samples=samples, jumps=jumps)
    assert [(row[0], row[2]) for row in _read(tmp_path / "run.csv")[1:]] == expected


@pytest.mark.parametrize(("name", "jumps"), [("run.csv", "none"), ("run.csv", "once"), ("run.npz", "after")])
def test_rows_of_jumps_that_there_are_not_are_refused(name, jumps, tmp_path):
    with pytest.raises(UsageError):
        hand_made.modes_of_different_size().save(tmp_path / name, jumps=jumps)
    assert not list(tmp_path.iterdir())


def test_rows_at_samples_with_strips(tmp_path):
    hand_made.bouncing_ball(bounces=1, wait=0.125).save(tmp_path / "run.csv", samples=[0.0, 2.0, 2.0625, 2.125])
    assert [row[:3] + row[4:5] for row in _read(tmp_path / "run.csv")[1:]] == [
        ["0.0", "fly", "0", "0.0"],
        ["2.0", "fly", "0", "-2.0"],
        ["2.0625", "fly", "0", "-2.0"],
        ["2.125", "fly", "0", "-2.0"],
        ["2.125", "fly", "1", "1.0"],
    ]


def test_chosen_columns(tmp_path):
    run = hand_made.modes_of_different_size()
    run.save(tmp_path / "run.csv", columns=["double", "w", "x"])
    assert _read(tmp_path / "run.csv")[0] == ["time", "mode", "j", "w", "x", "double"]
    assert _read(tmp_path / "run.csv")[-1] == ["3.0", "end", "4", "-1.0", "", ""]
    with pytest.raises(UsageError, match="no state or output is called dubble") as caught:
        run.save(tmp_path / "run.csv", columns=["dubble"])
    assert caught.value.hint == "did you mean 'double'?"
    with pytest.raises(UsageError, match="whole execution"):
        run.save(tmp_path / "run.npz", columns=["x"])


@pytest.mark.parametrize("name", ["run", "run.txt", "run.csv.gz"])
def test_an_unknown_suffix_is_refused(name, tmp_path):
    with pytest.raises(UsageError, match=r"should end in .csv, .parquet or .npz"):
        hand_made.jumping_input().save(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_failure_leaves_what_was_there(tmp_path, monkeypatch):
    run = hand_made.jumping_input()
    run.save(tmp_path / "run.csv")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}

    def full(table, file):
        file.write(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setitem(store._TABLES, ".csv", full)
    with pytest.raises(UsageError, match=r"cannot write .*run\.csv: No space left on device"):
        run.save(tmp_path / "run.csv")
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_an_interruption_leaves_nothing_behind(error, tmp_path):
    with pytest.raises(error), replacing(tmp_path / "x") as file:
        file.write(b"half")
        raise error
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_process_left_is_removed_and_what_another_writes_is_not(tmp_path):
    left = tmp_path / ".hsdsl-0123456789ab.part"
    left.write_bytes(b"half")
    (tmp_path / ".hsdsl-notes.txt").write_text("mine")
    with replacing(tmp_path / "x") as first:
        first.write(b"first")
        assert not left.exists()
        with replacing(tmp_path / "x") as second:
            second.write(b"second")
        assert (tmp_path / "x").read_bytes() == b"second"
    assert (tmp_path / "x").read_bytes() == b"first"
    assert sorted(path.name for path in tmp_path.iterdir()) == [".hsdsl-notes.txt", "x"]


WRITER = """
import sys
from hsdsl.base.atomic import replacing
for _ in range(25):
    with replacing(sys.argv[1]) as file:
        file.write(sys.argv[2].encode() * 1000)
"""


def test_processes_may_write_one_file_at_once_and_be_killed(tmp_path):
    """Eight processes with 25 files each, two of which are killed on the way."""
    commands = [[sys.executable, "-c", WRITER, str(tmp_path / "x"), str(k)] for k in range(8)]
    running = [subprocess.Popen(command, stderr=subprocess.PIPE) for command in commands]
    for process in running[:2]:
        while process.poll() is None and not list(tmp_path.glob(".hsdsl-*.part")):
            pass
        process.kill()
    for process in running[2:]:
        assert process.communicate()[1] == b"" and process.returncode == 0
    for process in running[:2]:
        process.communicate()
    with replacing(tmp_path / "y"):
        pass
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x", "y"]
    content = (tmp_path / "x").read_bytes()
    assert len(content) == 1000 and len(set(content)) == 1


def test_a_sidecar_that_cannot_be_written_spoils_the_table_too(tmp_path):
    (tmp_path / "run.csv.json").mkdir()
    with pytest.raises(UsageError, match=r"run\.csv\.json: it is a folder"):
        hand_made.jumping_input().save(tmp_path / "run.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv.json"]


def test_where_nothing_can_be_written(tmp_path):
    with pytest.raises(UsageError, match="there is no folder"), replacing(tmp_path / "no" / "x.csv"):
        pass
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(UsageError, match="not a regular file"), replacing(tmp_path / "pipe.csv"):
        pass


def test_permissions_and_links_are_kept(tmp_path):
    real, link = tmp_path / "real.csv", tmp_path / "link.csv"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    with replacing(link) as file:
        file.write(b"new")
    assert (real.read_text(), link.is_symlink(), stat.S_IMODE(real.stat().st_mode)) == ("new", True, 0o640)


def test_a_new_file_has_the_usual_permissions(tmp_path):
    (tmp_path / "plain").write_text("")
    with replacing(tmp_path / "new") as file:
        file.write(b"")
    assert (tmp_path / "new").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_csv_leaves_the_file_open_for_its_owner():
    file = io.BytesIO()
    hsdsl.analysis.store.table.write_csv(hand_made.jumping_input().rows(), file)
    assert file.getvalue().startswith(b"time,mode,j,x,u\n")
    assert not file.closed


def test_a_path_may_be_text(tmp_path):
    hand_made.jumping_input().save(str(tmp_path / "run.npz"))
    assert Path(tmp_path / "run.npz").stat().st_size > 0
