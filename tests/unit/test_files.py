"""Files as they are read: once, capped, by the same rules each time; what is kept belongs to the very bytes."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from importlib import import_module
from pathlib import Path

import pytest

import hsdsl
from hsdsl.analysis import store
from hsdsl.analysis.lint.fix import fix
from hsdsl.base import limits
from hsdsl.base.cache import key_of
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.base.limits import Limits, applied
from hsdsl.language import files as data
from hsdsl.language.files import read_bytes
from hsdsl.mathematics import program_cache

posix = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX files")
MODEL = """hsdsl: 1
modes: {{m: {{flow: {{x: {0}}}}}}}
initial: {{mode: m, x: 0}}
experiment: {{until: 1, method: euler, step: 1, scheme: relaxed}}
"""
LOCATED = MODEL.format(1).replace("method: euler, step: 1, scheme: relaxed", "scheme: located")
WITH_DATA = MODEL.format("u") + "inputs: {u: {file: u.csv}}\n"


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))


def end(model: hsdsl.Model) -> float:
    return model.simulate(engine="python").final["x"]


def replaced(path: Path, text: str) -> None:
    """Save as an editor does."""
    beside = path.with_suffix(f".{threading.get_ident()}")
    beside.write_text(text)
    os.replace(beside, path)


# The name of a step of loading, and where it is looked up.
STEPS = ["hsdsl.mathematics.program_cache.find", "hsdsl.language.elaborate.compose", "hsdsl.language.elaborate.read",
         "hsdsl.mathematics.program_cache.keep",
         "hsdsl.language.elaborate.define_inputs", "hsdsl.mathematics.lower.lower",
         "hsdsl.base.cache.keep", "hsdsl.base.cache.find"]  # fmt: skip


@pytest.mark.parametrize("saved", ["model", "data"])
@pytest.mark.parametrize("step", STEPS)
def test_a_save_between_two_steps_never_mixes_two_versions(step, saved, tmp_path, monkeypatch):
    path, table = tmp_path / "m.yaml", tmp_path / "u.csv"
    module, _, name = step.rpartition(".")
    original = getattr(import_module(module), name)
    number = 0

    def save() -> None:
        path.write_text(WITH_DATA.replace("x: 0", f"x: {number}" if saved == "model" else "x: 0"))
        table.write_text(f"time,u\n0,{number if saved == 'data' else 0}\n")

    def step_after_a_save(*arguments, **named):
        nonlocal number
        number += 1
        save()
        return original(*arguments, **named)

    save()
    for _ in range(3):
        before = number
        with monkeypatch.context() as patched:
            patched.setattr(step, step_after_a_save)
            model = hsdsl.load(path)
            assert before <= end(model) <= number
        assert end(hsdsl.load(path)) == number and end(hsdsl.load(path)) == number
        assert end(model) == model.simulate(until="1/2 + 1/2", engine="python").final["x"]


def test_what_is_loaded_while_others_save_is_one_of_what_they_saved(tmp_path):
    path, done = tmp_path / "m.yaml", threading.Event()
    path.write_text(MODEL.format(0))

    def save() -> None:
        number = 0
        while not done.is_set():
            number = (number + 1) % 7
            replaced(path, MODEL.format(number))

    thread = threading.Thread(target=save)
    thread.start()
    try:
        for _ in range(200):
            model = hsdsl.load(path)
            flow = hsdsl.load(path, text=model.pipeline._files.text)
            assert end(model) == end(flow) and f"x: {end(model):.0f}}}".encode() in model.pipeline._files.text
    finally:
        done.set()
        thread.join()
    for number in range(7):
        path.write_text(MODEL.format(number))
        assert end(hsdsl.load(path)) == number


def test_a_fix_is_not_written_over_what_was_saved_meanwhile(tmp_path, monkeypatch):
    path = tmp_path / "m.yaml"
    edge = "x: 1, y: 1}, transitions: [{when: x >= 5, to: m, reset: {x: 0, y: y}}]"
    path.write_text(LOCATED.replace("x: 1}", edge).replace("x: 0}", "x: 0, y: 0}"))
    look = sys.modules["hsdsl.analysis.lint.fix"].lint

    def looked_after_a_save(*arguments, **named):
        path.write_text("# mine\n")
        return look(*arguments, **named)

    monkeypatch.setattr("hsdsl.analysis.lint.fix.lint", looked_after_a_save)
    with pytest.raises(UsageError, match="changed meanwhile"):
        fix(path)
    assert path.read_text() == "# mine\n"


@pytest.mark.parametrize("extra", [-1, 0, 1, 2, 3, 4])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_a_file_is_whole_or_too_large(mark, extra, tmp_path):
    text = mark + MODEL.format(3).encode()
    (tmp_path / "m.yaml").write_bytes(text)
    with applied(Limits(bytes=len(text) + extra)):
        if extra >= 0:
            assert end(hsdsl.load(tmp_path / "m.yaml")) == 3
        else:
            with pytest.raises(ModelError, match="larger than"):
                hsdsl.load(tmp_path / "m.yaml")


@posix
def test_no_more_is_read_than_may_be(tmp_path):
    with (tmp_path / "sparse.yaml").open("wb") as file:
        file.truncate(1 << 40)
    assert len(read_bytes(tmp_path / "sparse.yaml")) == limits.DEFAULT.bytes + 1
    with pytest.raises(ModelError, match="HS003"):
        hsdsl.load(tmp_path / "sparse.yaml")


DEVICES = ["/dev/zero", "/dev/null", "/dev/urandom", "/dev/full"]


@posix
@pytest.mark.parametrize("device", [name for name in DEVICES if os.path.exists(name)])
def test_a_device_is_no_model_and_no_data(device, tmp_path):
    (tmp_path / "m.yaml").symlink_to(device)
    for path in (device, tmp_path / "m.yaml"):
        with pytest.raises(UsageError, match="this is a device, not a file"):
            hsdsl.load(path)


def shell(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = command.replace("hsdsl ", f"{sys.executable} -m hsdsl ")
    done = subprocess.run(["bash", "-c", command], cwd=folder, capture_output=True, text=True, timeout=120)
    assert "Traceback" not in done.stderr
    return done


PIPES = [
    "cat m.yaml | hsdsl run - --json --engine python",
    "hsdsl run - --json --engine python < m.yaml",
    "cat m.yaml | hsdsl run /dev/stdin --json",
    "(cat m.yaml; sleep 0.3; cat rest) | hsdsl run - --json --engine python",
    "hsdsl run <(cat m.yaml) --json --engine python",
    "mkfifo p; (sleep 0.3; cat m.yaml > p) & hsdsl run p --json --engine python",
]


@posix
@pytest.mark.parametrize("command", PIPES)
def test_a_model_comes_through_a_pipe(command, tmp_path, with_loop):
    with_loop()
    (tmp_path / "m.yaml").write_text(WITH_DATA)
    (tmp_path / "rest").write_text("# the end\n")
    (tmp_path / "u.csv").write_text("time,u\n0,7\n")
    done = shell(command, tmp_path)
    assert done.returncode == 0 and '"x": 7.0' in done.stdout, done.stderr


@posix
def test_every_verb_reads_a_pipe_once(tmp_path, with_loop):
    with_loop()
    (tmp_path / "m.yaml").write_text(LOCATED)
    for verb in ("validate -", "lint -", "distance - --from 'm x=0' --to 'm x=1'", "distance - m.yaml", "lint --fix -"):
        done = shell(f"cat m.yaml | hsdsl {verb}", tmp_path)
        assert done.returncode == 0 or "written back" in done.stderr, done.stderr


@posix
@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        ("yes | hsdsl validate -", "larger than 1 MiB"),
        ("hsdsl validate - < /dev/zero", "this is a device"),
        ("hsdsl validate - < /dev/null", "this is a device"),
        ("hsdsl validate - <&-", "no standard input"),
        ("true | hsdsl validate -", "the file is empty"),
        ("mkfifo p; yes > p & hsdsl validate p", "larger than 1 MiB"),
    ],
)
def test_what_has_no_end_or_no_content_is_refused(command, sentence, tmp_path):
    done = shell(command, tmp_path)
    assert done.returncode in (1, 2) and sentence in done.stderr, done.stderr


@posix
def test_a_pipe_to_which_nobody_writes_is_left_after_a_while(tmp_path, monkeypatch):
    monkeypatch.setattr("hsdsl.language.files._SILENCE", 0.05)
    os.mkfifo(tmp_path / "m.yaml")
    with pytest.raises(UsageError, match="nobody writes to this pipe"):
        hsdsl.load(tmp_path / "m.yaml")


def _linked_away(path: Path) -> None:
    other = path.parent.parent / "elsewhere.csv"
    other.write_bytes(path.read_bytes())
    path.unlink()
    path.symlink_to(other)


def _pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def _device(path: Path) -> None:
    path.unlink()
    path.symlink_to("/dev/zero")


def _in_a_loop(path: Path) -> None:
    path.unlink()
    path.symlink_to(path)


def _too_large(path: Path) -> None:
    with path.open("ab") as file:
        file.truncate(data.LARGEST + 1)


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


RULES = [
    (_linked_away, "HS317"), (_pipe, "HS311"), (_device, "HS317"), (_in_a_loop, "HS3"), (_too_large, "HS311"),
    (_folder, "HS311"), (Path.unlink, "HS311"),
]  # fmt: skip


@posix
@pytest.mark.parametrize("cached", [False, True])
@pytest.mark.parametrize(("change", "code"), RULES)
def test_the_rules_for_data_hold_for_a_model_seen_before(change, code, cached, tmp_path):
    folder = tmp_path / "models"
    folder.mkdir()
    (folder / "m.yaml").write_text(WITH_DATA)
    (folder / "u.csv").write_text("time,u\n0,1\n")
    if cached:
        assert end(hsdsl.load(folder / "m.yaml")) == 1
    change(folder / "u.csv")
    with pytest.raises(ModelError, match=code):
        hsdsl.load(folder / "m.yaml")


def test_copies_in_two_folders_have_their_own_data_and_both_are_kept(tmp_path):
    for number in (1, 2):
        (tmp_path / str(number)).mkdir()
        (tmp_path / str(number) / "m.yaml").write_text(WITH_DATA)
        (tmp_path / str(number) / "u.csv").write_text(f"time,u\n0,{number}\n")
    for _ in range(2):
        for number in (1, 2):
            assert end(hsdsl.load(tmp_path / str(number) / "m.yaml")) == number
    assert all("program" in vars(hsdsl.load(tmp_path / number / "m.yaml").pipeline) for number in "12")


@posix
@pytest.mark.parametrize("name", ["\udcff", "\x1b[31m", "a\nb", "\u202e", "'\"$ "], ids=ascii)
def test_a_folder_may_have_any_name(name, tmp_path, monkeypatch):
    folder = tmp_path / name
    folder.mkdir()
    (folder / "m.yaml").write_text(WITH_DATA)
    (folder / "u.csv").write_text("time,u\n0,3\n")
    for _ in range(2):
        assert end(hsdsl.load(folder / "m.yaml")) == 3
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    for _ in range(2):
        assert end(hsdsl.load(folder / "m.yaml")) == 3
    (run,) = hsdsl.load(folder / "m.yaml").simulate(engine="python").save(folder / "run.npz")
    assert hsdsl.distance(store.load(run), store.load(run)).upper == 0


def test_copies_without_data_share_what_is_kept(tmp_path):
    for number in "12":
        (tmp_path / number).mkdir()
        (tmp_path / number / "m.yaml").write_text(MODEL.format(4))
    assert end(hsdsl.load(tmp_path / "1" / "m.yaml")) == 4
    second = hsdsl.load(tmp_path / "2" / "m.yaml")
    assert "program" in vars(second.pipeline) and second.program.path == str(tmp_path / "2" / "m.yaml")


def test_a_folder_that_is_no_longer_allowed_is_not_read(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "models").mkdir()
    (tmp_path / "data" / "u.csv").write_text("time,u\n0,1\n")
    path = tmp_path / "models" / "m.yaml"
    path.write_text(WITH_DATA.replace("u.csv", "../data/u.csv"))
    for _ in range(2):
        assert end(hsdsl.load(path, Limits(folders=(tmp_path / "data",)))) == 1
        with pytest.raises(ModelError, match="HS317"):
            hsdsl.load(path)


def test_bytes_that_move_from_one_data_file_to_the_other_are_another_model(tmp_path):
    """The checksum of everything in one does not see where a file ends."""
    path = tmp_path / "m.yaml"
    path.write_text(MODEL.format("u + 10*v") + "inputs: {u: {file: u.csv}, v: {file: v.csv}}\n")
    rows = "time,u,v\n0,1,2\n", "1,3,4\n", "time,u,v\n0,1,2\n"
    (tmp_path / "u.csv").write_text(rows[0] + rows[1])
    (tmp_path / "v.csv").write_text(rows[2])
    first = end(hsdsl.load(path))
    (tmp_path / "u.csv").write_text(rows[0])
    (tmp_path / "v.csv").write_text(rows[1] + rows[2])
    assert first == 21
    with pytest.raises(ModelError, match="expected the columns `time` and `v`"):
        hsdsl.load(path)


def test_a_part_of_a_model_is_of_the_bytes_that_were_loaded(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text(WITH_DATA.replace("x: u", "x: u, y: 2*x").replace("x: 0", "x: 0, y: 0"))
    for number in (1, 2):
        (tmp_path / "u.csv").write_text(f"time,u\n0,{number}\n")
        model = hsdsl.load(path)
        (tmp_path / "u.csv").write_text("time,u\n0,9\n")
        for _ in range(2):
            part = model.only(["x"])
            assert end(part) == number and part.program.left_out == ("y",)
            assert part.system.modes[0].states == ("x",)
        assert model.only(["x", "y"]) is model and model.only(["y"]) is model


def test_keys_are_of_bytes_and_not_of_names():
    assert key_of(b"ab", "c") != key_of(b"a", "bc") and program_cache.KIND != "compiled"
