"""Sweeps: every row is what a single run gives, whoever runs it, and however often it was interrupted."""

from __future__ import annotations

import json
import os
from dataclasses import replace

import hand_made
import numpy as np
import pytest

import hsdsl
from hsdsl.analysis.sweep import Recording, load, manifest, picture, variation
from hsdsl.analysis.sweep.dataset import damaged
from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Stop

parquet = pytest.importorskip("pyarrow.parquet")

TEXT = """
hsdsl: 1
title: A ball that is thrown
units: {x: m, v: m/s}
parameters: {g: {value: 9.81, min: 0}, c: 0.8, stop: 2}
modes:
  up:
    flow: {x: v, v: -g}
    domain: [x <= 30]
    transitions: [{name: top, when: v <= 0, to: down}]
  down:
    flow: {x: v, v: -g}
    transitions: [{name: floor, when: x <= 0, to: up, reset: {v: -c*v}}]
outputs: {energy: v**2/2 + g*x}
initial: {mode: up, x: 0, v: 5}
experiment: {until: stop, tolerance: 1e-9}
"""
VARY = {"c": "0.7:0.9:3", "initial.v": [4, 6, 8, 10]}
RECORD = "final,transitions,outputs:every=stop/4,verdict"


@pytest.fixture(scope="module")
def model() -> hsdsl.Model:
    return hsdsl.loads(TEXT)


def number(value: object, where: str) -> float:
    return float(value)  # pyright: ignore[reportArgumentType]


def read(texts, random=None, seed=0):
    return variation.read(texts, random, seed, number)


def test_grids_are_products_with_the_first_name_slowest():
    found = read(["a=0:1:3", "b=1:100:2:log", "c=7,5"])
    values = found.values(0, found.rows)
    assert found.rows == 12
    assert values["a"].tolist() == [0] * 4 + [0.5] * 4 + [1] * 4
    assert values["b"].tolist() == [1, 1, 100, 100] * 3 and values["c"].tolist() == [7, 5] * 6


def test_draws_are_those_of_the_row_and_of_the_name():
    texts = ["a=1,2,3", "b~normal(5, 2)", "c~uniform(0, 1)"]
    found, alone = read(texts, 1000, 7), read(["b~normal(5, 2)"], 3000, 7)
    whole = found.values(0, 3000)
    parts = [found.values(first, last) for first, last in ((0, 1), (1, 6), (6, 1003), (1003, 3000))]
    for name in "abc":
        assert np.concatenate([part[name] for part in parts]).tolist() == whole[name].tolist()
    assert whole["b"].tolist() == alone.values(0, 3000)["b"].tolist()  # what else varies does not matter
    assert len({*whole["b"], *whole["c"]}) == 6000
    assert read(texts, 1000, 8).values(0, 3000)["b"][0] != whole["b"][0]


@pytest.mark.parametrize(
    ("text", "mean", "deviation"),
    [
        ("uniform(2, 5)", 3.5, 3 / 12**0.5),
        ("normal(-3, 2)", -3, 2),
        ("lognormal(0, 0.5)", np.exp(0.125), np.exp(0.125) * (np.exp(0.25) - 1) ** 0.5),
        ("loguniform(1, 10)", 9 / np.log(10), (99 / 2 / np.log(10) - (9 / np.log(10)) ** 2) ** 0.5),
        ("exponential(4)", 4, 4),
        ("triangular(0, 1, 4)", 5 / 3, (13 / 18) ** 0.5),
    ],
)
def test_draws_have_the_moments_of_their_distribution(text, mean, deviation):
    count = 200_000
    values = read([f"a~{text}"], count, 3).values(0, count)["a"]
    assert abs(values.mean() - mean) < 5 * deviation / count**0.5  # five standard errors
    assert abs(values.std() / deviation - 1) < 0.02


@pytest.mark.parametrize(
    ("texts", "random", "sentence"),
    [
        ([], None, "something that varies"),
        (["c"], None, "expected NAME=VALUES"),
        (["c=1:2"], None, "expected FROM:TO:COUNT"),
        (["c=1:2:0"], None, "expected FROM:TO:COUNT"),
        (["c=-1:2:5:log"], None, "expected positive ends"),
        (["c=1:2:3", "c=4"], None, "c varies twice"),
        (["c~normal(0, 1)"], None, "the number of draws is missing"),
        (["c~normal(0, 1)"], 0, "expected at least 1"),
        (["c=1:2:3"], 5, "nothing is drawn"),
        (["c~gauss(0, 1)"], 5, "no distribution 'gauss'"),
        (["c~normal(0)"], 5, "expected normal(mean, deviation), got 1 number"),
        (["c~uniform(2, 1)"], 5, "needs low < high"),
        ({"c": [[1, 2]]}, None, "an array of shape"),
        ({"c": [1, float("inf")]}, None, "expected finite numbers"),
    ],
)
def test_what_cannot_vary_is_refused(texts, random, sentence):
    with pytest.raises(UsageError, match=sentence.replace("(", r"\(").replace(")", r"\)")):
        read(texts, random)


@pytest.mark.parametrize("text", ["finals", "outputs", "outputs:every", "outputs:count=1", "final:every=1", ""])
def test_what_cannot_be_recorded_is_refused(text):
    with pytest.raises(UsageError, match="--record"):
        Recording.read(text)


def test_rows_are_single_runs(model, tmp_path):
    found = model.sweep(VARY, tmp_path / "s", record=RECORD, parameters={"g": 10}, chunk=5, processes=1)
    assert f"{found.rows:,} of {found.rows:,} rows" in found._repr_html_()
    assert hsdsl.sweep.load(tmp_path / "s").rows == found.rows
    assert found.complete and sorted(found.chunks) == [0, 1, 2]
    rows = found.table().to_pylist()
    for k in (0, 6, 11):
        row = rows[k]
        run = model.simulate(parameters={"g": 10, "c": row["c"]}, initial={"v": row["initial.v"]})
        assert (row["row"], row["stop"], row["message"], row["mode"]) == (k, "until", None, run.final.mode)
        assert (row["time"], row["transitions"]) == (2.0, len(run.transitions))
        assert (row["verdict"], row["verdict.reasons"]) == (run.verdict.theorem, [*run.verdict.reasons])
        assert {n: row[f"final.{n}"] for n in ("x", "v", "energy")} == run.final.state | run.final.outputs
        assert row["transition.name"] == [t.edge for t in run.transitions]
        assert row["before.v"] == [t.before["v"] for t in run.transitions]
        assert row["after.v"] == [t.after["v"] for t in run.transitions]
        assert row["sample.time"] == [0.0, 0.5, 1.0, 1.5, 2.0]
        assert row["sample.energy"] == run.sample(row["sample.time"])["energy"].tolist()


def test_workers_and_chunks_make_no_difference(model, tmp_path):
    arguments = {"vary": ["c=0.5:0.9:3", "g~uniform(5, 15)"], "random": 20, "seed": 4, "record": "final,transitions"}
    one = model.sweep(out=tmp_path / "one", processes=1, chunk=60, **arguments)
    two = model.sweep(out=tmp_path / "two", processes=2, chunk=7, **arguments)
    assert one.rows == 60 and one.table().equals(two.table())
    import pandas

    assert pandas.read_parquet(tmp_path / "two")["c"].nunique() == 3  # any reader opens the folder


class Stopped(Exception):
    pass


def stop_after(rows: int):
    def progress(done: int, count: int) -> None:
        if done >= rows:
            raise Stopped

    return progress


@pytest.mark.parametrize("processes", [1, 2])
def test_an_interrupted_sweep_opens_and_goes_on(model, tmp_path, processes):
    arguments = {"vary": VARY, "record": "final,transitions", "processes": processes}
    whole = model.sweep(out=tmp_path / "whole", **arguments).table()
    with pytest.raises(Stopped):
        model.sweep(out=tmp_path / "s", chunk=2, progress=stop_after(4), **arguments)
    found = load(tmp_path / "s")
    assert 4 <= found.done < 12 and found.table().num_rows == found.done and "goes on" in found.summary
    shown: list[tuple[int, int]] = []
    found = model.sweep(out=tmp_path / "s", progress=lambda *t: shown.append(t), **arguments)
    assert shown[0][0] >= 4 and shown[-1] == (12, 12) and found.table().equals(whole)
    shown.clear()
    assert model.sweep(out=tmp_path / "s", progress=lambda *t: shown.append(t), **arguments).complete
    assert shown == [(12, 12)]  # nothing is run again


def test_damaged_files_are_made_again(model, tmp_path):
    arguments = {"vary": VARY, "out": tmp_path / "s", "chunk": 2, "processes": 1, "record": "final,transitions"}
    found = model.sweep(**arguments)
    whole, paths = found.table(), found.chunks
    paths[0].write_bytes(paths[0].read_bytes()[:-20])
    content, column = bytearray(paths[1].read_bytes()), parquet.ParquetFile(paths[1]).metadata.row_group(0).column(0)
    content[column.data_page_offset + column.total_compressed_size - 1] ^= 0xFF  # the last byte of a page
    paths[1].write_bytes(content)
    paths[2].write_bytes(b"")
    other = model.sweep(**arguments | {"out": tmp_path / "other", "parameters": {"g": 10}})
    paths[3].write_bytes(other.chunks[3].read_bytes())
    assert list(damaged(found)) == [0, 1, 2, 3]
    with pytest.raises(UsageError, match=r"chunk-000000.parquet is damaged"):
        found.table()
    assert model.sweep(**arguments).table().equals(whole)


def test_another_model_or_other_settings_are_refused(model, tmp_path):
    out = tmp_path / "s"
    arguments = {"vary": VARY, "out": out, "processes": 1}
    model.sweep(**arguments, chunk=3)
    for changed, words in (
        ({"parameters": {"g": 10}}, "the settings"),
        ({"vary": {"c": [0.5]}}, "what varies"),
        ({"record": "transitions"}, "what is recorded"),
        ({"outputs": ["x"]}, "the columns"),
        ({"chunk": 5}, "chunks of 3 rows, not 5"),
    ):
        with pytest.raises(UsageError, match=words):
            model.sweep(**arguments | changed)
    with pytest.raises(UsageError, match=r"differs in the model\n"):
        hsdsl.loads(TEXT.replace("g*x}", "g*x + 0}")).sweep(**arguments)
    assert model.sweep(**arguments).complete


def test_manifests_that_cannot_be_read(model, tmp_path):
    path = tmp_path / "_sweep.json"
    with pytest.raises(UsageError, match="is not a sweep"):
        load(tmp_path)
    path.write_text("{")
    with pytest.raises(UsageError, match="it is damaged"):
        load(tmp_path)
    path.unlink()
    model.sweep({"c": [0.5]}, tmp_path, processes=1)
    path.write_text(json.dumps(json.loads(path.read_text()) | {"version": 99}))
    with pytest.raises(UsageError, match="a later version of hsdsl wrote it, in format 99"):
        load(tmp_path)
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "mine.txt").write_text("")
    with pytest.raises(UsageError, match="is not an empty folder"):
        model.sweep({"c": [0.5]}, tmp_path / "x")


@pytest.mark.parametrize("engine", ["auto", "python"])
def test_failures_are_rows_with_their_reason(model, tmp_path, engine):
    vary = {"g": [-1, 0.1, 9.81], "initial.v": [5, 20]}
    found = model.sweep(
        vary, tmp_path / "s", engine=engine, max_transitions=2, parameters={"stop": 5}, chunk=2, processes=1,
        record="final,outputs:count=3,transitions",
    )  # fmt: skip
    rows = found.table().to_pylist()
    assert [row["stop"] for row in rows] == ["refused"] * 2 + ["until", "left_domain", "transition_limit", "until"]
    assert rows[0]["message"] == "parameter g = -1 is beyond its minimum 0" and rows[0]["final.x"] is None
    assert "the domain of mode up ends at x <= 30" in rows[3]["message"] and rows[3]["verdict"] == "left"
    assert rows[3]["sample.time"] == [0.0] and rows[0]["initial.v"] == 5
    limit = model.simulate(parameters={"stop": 5}, max_transitions=2).stop.message
    assert rows[4]["message"] == limit and len(rows[4]["transition.time"]) == rows[4]["transitions"] == 2
    assert "  refused, the first of them: parameter g = -1 is beyond its minimum 0" in found.summary
    assert found.reasons == {"refused": 2, "until": 2, "left_domain": 1, "transition_limit": 1}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"vary": {"d": [1]}}, "no parameter or initial value 'd'"),
        ({"vary": {"until": [1]}}, "no parameter or initial value 'until'"),
        ({"vary": {"x": [1]}}, "no parameter or initial value 'x'"),
        ({"parameters": {"c": 1}}, "c is both set and varied"),
        ({"until": "later"}, "later"),
        ({"steps": 3}, "a sweep has no argument 'steps'"),
        ({"chunk": 0}, "at least 1 row"),
        ({"record": "outputs:every=-stop"}, "must be positive"),
        ({"outputs": ["y"]}, "no state or output 'y'"),
    ],
)
def test_what_cannot_be_run_is_refused_before_a_folder_is_made(model, tmp_path, change, sentence):
    with pytest.raises(UsageError, match=sentence):
        model.sweep(**{"vary": {"c": [0.5, 0.6]}, "out": tmp_path / "s"} | change)
    assert not (tmp_path / "s").exists()


def test_a_process_that_dies_loses_nothing(model, tmp_path, monkeypatch):
    from hsdsl.interface.model.sweeps import ChunkWork

    made, fuse = ChunkWork.__call__, tmp_path / "fuse"
    fuse.touch()

    def fragile(self, chunk):
        if chunk == 3 and fuse.exists():
            fuse.unlink()
            os._exit(1)
        return made(self, chunk)

    monkeypatch.setattr(ChunkWork, "__call__", fragile)
    found = model.sweep(VARY, tmp_path / "s", chunk=2, processes=2)
    assert found.complete and not fuse.exists()


def test_a_chunk_that_ends_every_process_ends_the_sweep(model, tmp_path, monkeypatch):
    from hsdsl.interface.model.sweeps import ChunkWork

    made = ChunkWork.__call__
    monkeypatch.setattr(ChunkWork, "__call__", lambda self, k: os._exit(1) if k == 3 else made(self, k))
    with pytest.raises(UsageError, match="3 workers died while they ran chunk 3"):
        model.sweep(VARY, tmp_path / "s", chunk=2, processes=2)
    assert load(tmp_path / "s").done == 10


@pytest.mark.parametrize(
    ("vary", "of", "kind"),
    [
        (["c=0.5:0.9:3"], None, "<path"),
        (["c=0.5:0.9:3"], "mode", "<path"),
        (["c=0.5:0.9:3"], "before.v", "<image"),
        (["c=0.5:0.9:3"], "sample.x", "<image"),
        (["c=0.5:0.9:3", "initial.v=4:10:4"], "final.x", "<image"),
        (["g=0.1:1:3:log", "initial.v=4,20"], "stop", "<image"),
        (["c~uniform(0.5, 0.9)", "g~uniform(5, 9)"], "final.x", "<path"),
    ],
)
def test_pictures(model, tmp_path, vary, of, kind):
    random = 5 if "~" in vary[0] else None
    found = model.sweep(vary, tmp_path / "s", record="final,transitions,outputs:count=5", random=random, processes=1)
    found.plot(tmp_path / "p.svg", of)
    assert kind in (tmp_path / "p.svg").read_text()


@pytest.mark.parametrize("vary", [["c=0.5:0.9:3"], ["g=0.1:1:3:log", "initial.v=4,20"], ["c~uniform(0.5, 0.9)"]])
def test_samples_are_drawn_over_time(model, tmp_path, vary):
    random = 4 if "~" in vary[0] else None
    found = model.sweep(vary, tmp_path / "s", record="final,outputs:count=7", random=random, processes=1)
    curves = picture._curves(found, "sample.x")
    assert len(curves) == found.rows
    for k, (times, values) in enumerate(curves):
        assert times[0] == 0 and len(times) == len(values)
        if found["stop"][k] == "until":
            assert (times[-1], values[-1]) == (found["time"][k], found["final.x"][k])
    for of in ("sample.x", None):
        found.plot(tmp_path / "p.svg", of, over="time")
        assert "time t" in (tmp_path / "p.svg").read_text() or "<image" in (tmp_path / "p.svg").read_text()
    for of, over, sentence in (("final.x", "time", "has no samples"), ("sample.x", "t", "expected time")):
        with pytest.raises(UsageError, match=sentence):
            found.plot(tmp_path / "p.svg", of, over=over)


def test_where_no_column_is_named_the_most_telling_one_is_drawn(model, tmp_path):
    telling = picture.telling
    one = {"c": [0.7, 0.8]}
    assert telling(model.sweep(one, tmp_path / "a", processes=1, record="transitions")) == "before.v"  # x stays
    assert telling(model.sweep(one, tmp_path / "b", processes=1)) == "transitions"
    assert telling(model.sweep(VARY, tmp_path / "c", processes=1, record="transitions")) == "transitions"


def test_slices_of_more_names_than_axes(model, tmp_path, monkeypatch):
    """Values are the nearest of their grids."""
    from hsdsl.analysis.plot import analyses

    vary = {"c": [0.7, 0.8], "initial.v": [4, 6, 8], "g": [9, 10]}
    found, drawn = model.sweep(vary, tmp_path / "s", record="final,transitions", processes=1), {}
    for name in ("plot_curve", "plot_map", "plot_dots"):
        monkeypatch.setattr(analyses, name, lambda path, *given, name=name: drawn.update({name: given}))
    table = found.to_pandas()
    found.plot("p.svg", "final.x", at={"g": 9.4})
    c, v, of, title = drawn["plot_map"]
    rows = table[table.g == 9]
    assert (c.values.tolist(), v.values.tolist()) == (rows.c.tolist(), rows["initial.v"].tolist())
    assert of.values.tolist() == rows["final.x"].tolist() and title == "A ball that is thrown, g = 9"
    found.plot("p.svg", "final.x", at={"g": 9.6, "initial.v": 6.0})
    rows = table[(table.g == 10) & (table["initial.v"] == 6)]
    assert drawn["plot_curve"][1].values.tolist() == rows["final.x"].tolist()
    found.plot("p.svg", "before.v", at={"g": 9.6, "initial.v": 6.0}, tail=1)
    c, of, where, _ = drawn["plot_dots"]
    assert of.values.tolist() == np.concatenate([*rows["before.v"]]).tolist()
    assert c.values[where].tolist() == np.repeat(rows.c, rows.transitions).tolist()
    for at, sentence in (
        ({"h": 1}, "nothing varies 'h'"),
        ({"g": 11}, "expected 9 to 10"),
        (dict.fromkeys(vary, 8), "c: exp"),
    ):
        with pytest.raises(UsageError, match=f"--slice.*{sentence}"):
            found.plot("p.svg", "final.x", at=at)
    with pytest.raises(UsageError, match=r"a map shows two varied names, got c, initial.v, g") as refusal:
        found.plot("p.svg", "final.x")
    assert refusal.value.hint == "draw a slice: --slice g=9"


def test_a_slice_of_a_draw_has_the_nearest_tenth_of_the_rows(model, tmp_path, monkeypatch):
    from hsdsl.analysis.plot import analyses

    vary = ["c~uniform(0.5, 0.9)", "initial.v=4,6", "g=9,10"]
    found, drawn = model.sweep(vary, tmp_path / "s", random=50, processes=1), []
    monkeypatch.setattr(analyses, "plot_map", lambda path, *given: drawn.extend(given))
    found.plot("p.svg", "final.x", at={"c": 0.7})
    table = found.to_pandas()
    off = (table.c - 0.7).abs()
    rows = table[off <= off.nsmallest(20).max()]
    assert len(rows) == 20 and sorted(drawn[2].values.tolist()) == sorted(rows["final.x"].tolist())
    assert drawn[3] == "A ball that is thrown, c near 0.7"


def test_the_worst_and_the_best_rows(model, tmp_path):
    found = model.sweep(VARY | {"g": [9.81, -1]}, tmp_path / "s", processes=1, until=1, outputs=["x"])
    ends = found["final.x"]
    known = np.flatnonzero(np.isfinite(ends))
    assert 0 < len(known) < len(ends)  # a negative g is refused
    for rows, order in ((found.worst("final.x", 5), -ends[known]), (found.best("final.x", 5), ends[known])):
        assert [row["row"] for row in rows] == known[np.argsort(order, kind="stable")][:5].tolist()
        assert all(row["final.x"] == ends[row["row"]] and row["c"] == found["c"][row["row"]] for row in rows)
    assert len(found.best("final.x", 1000)) == len(known)
    assert found.command(2).endswith("--until=1 --set c=0.7 --set initial.v=6.0 --set g=9.81")
    for column, sentence in (
        ("mode", "'mode' has no numbers"),
        ("final.y", "'final.y' is no column"),
        ("row", "no numb"),
    ):
        with pytest.raises(UsageError, match=sentence):
            found.worst(column)


def test_a_zeno_row_names_its_edges_in_few_words(tmp_path):
    relay = hsdsl.loads(
        "hsdsl: 1\nparameters: {a: 1}\nmodes:\n"
        "  plus: {flow: {x: -a}, transitions: [{name: down, when: x <= 0, to: minus}]}\n"
        "  minus: {flow: {x: a}, transitions: [{name: up, when: x >= 0, to: plus}]}\n"
        "initial: {mode: plus, x: 1}\nexperiment: {until: 3, completion: none}\n"
    )
    found = relay.sweep({"a": [0.1, 1, 2]}, tmp_path / "s", processes=1)
    assert found["stop"].tolist() == ["until", "zeno", "zeno"]
    _, one, two = found["message"].tolist()
    assert one == "transitions of down, up accumulate at t = 1; no motion is known there"
    assert "t = 0.5;" in two and all(len(text.split()) <= 20 for text in (one, two))


def test_a_reason_names_at_most_three_edges():
    run = hand_made.bouncing_ball()
    made = [replace(run.transitions[0], edge=name) for name in ["other", *"abcde" * 2]]
    zeno = replace(run, transitions=made, stop=Stop("zeno", 1.25, ""))
    text = manifest.accumulating(zeno)
    assert text == "transitions of a, b, c and 2 more accumulate at t = 1.25; no motion is known there"
    assert manifest.accumulating(replace(zeno, transitions=made[:6])) is None


def test_pictures_that_cannot_be_drawn_are_refused(model, tmp_path):
    found = model.sweep(VARY, tmp_path / "s", processes=1, record="final,transitions")
    for of, tail, sentence in (
        ("sample.x", 1, "no column 'sample.x' to draw"),
        ("row", 1, "no column 'row' to draw"),
        ("before.v", 1, "a bifurcation diagram shows one varied name"),
        ("final.x", 0, "expected a share"),
    ):
        with pytest.raises(UsageError, match=sentence):
            found.plot(tmp_path / "p.png", of, tail=tail)
    with pytest.raises(UsageError, match=r"--of before.x: there is none in the last 0.001 of each run"):
        model.sweep({"c": [0.8]}, tmp_path / "t", processes=1, record="transitions").plot(
            tmp_path / "p.png", "before.x", tail=0.001
        )


@pytest.mark.slow
def test_a_cluster_gives_the_same(model, tmp_path):
    distributed = pytest.importorskip("distributed")
    arguments = {"vary": VARY, "record": "final,transitions"}
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster:
        found = model.sweep(out=tmp_path / "there", cluster=cluster.scheduler_address, chunk=3, **arguments)
    assert found.complete and found.table().equals(model.sweep(out=tmp_path / "here", **arguments).table())


def test_a_cluster_that_does_not_answer_is_refused(model, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("hsdsl.analysis.sweep.cluster.CONNECTION_TIMEOUT", 0.2)
    with pytest.raises(UsageError, match="no scheduler answers there"):
        model.sweep(VARY, tmp_path / "s", cluster="tcp://127.0.0.1:9")
    assert not (tmp_path / "s").exists()


@pytest.mark.slow
def test_a_cluster_that_is_lost_loses_nothing(model, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr("hsdsl.analysis.sweep.cluster.CONNECTION_TIMEOUT", 0.5)
    arguments = {"vary": {"c": "0.7:0.9:200"}, "out": tmp_path / "s", "chunk": 5}
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    cluster = distributed.LocalCluster(**options)

    def progress(done: int, rows: int) -> None:
        if done >= 10:
            cluster.close()

    with pytest.raises(UsageError, match=r"the cluster at .* is lost"):
        model.sweep(cluster=cluster.scheduler_address, progress=progress, **arguments)
    assert 10 <= load(tmp_path / "s").done < 200
    assert model.sweep(**arguments, processes=1).complete


def test_numbers_and_their_texts_are_one_experiment(model, tmp_path):
    """A command line gives texts, Python gives numbers."""
    given = {"until": "1", "parameters": {"g": "9.5"}, "settings": {"step": "1/100", "scheme": "relaxed"}}
    first = model.sweep(["c=0.7,0.8"], tmp_path, **given)
    again = model.sweep(
        {"c": [0.7, 0.8]}, tmp_path, until=1, parameters={"g": 9.5}, settings={"step": "1/100", "scheme": "relaxed"}
    )
    assert again.table().equals(first.table())
    with pytest.raises(UsageError, match="differs in the settings"):
        model.sweep(["c=0.7,0.8"], tmp_path, **given | {"until": 2})


def test_ranges_are_aligned_for_long_names(tmp_path):
    text = TEXT.replace("energy", "energy_of_the_whole_ball")
    lines = hsdsl.loads(text).sweep(["c=0.7,0.8"], tmp_path).summary.splitlines()
    rows = [line for line in lines if " mean " in line]
    assert len(rows) == 5 and len({(row.index(" to "), row.index(" mean ")) for row in rows}) == 1


def test_models_without_a_file_are_called_so(model, tmp_path):
    plain = hsdsl.loads(TEXT.replace("title:", "source:"))
    for one, name in ((model, "A ball that is thrown"), (plain, "a model without a file")):
        ensemble = one.ensemble(parameters={"c": [0.7, 0.8]})
        sweep = one.sweep(["c=0.7,0.8"], tmp_path / name)
        for shown in (repr(ensemble), ensemble._repr_html_(), repr(sweep), sweep.summary):
            assert name in shown and "text>" not in shown


def test_an_initial_box_is_drawn_from_where_nothing_else_is_given(tmp_path):
    box = hsdsl.loads(TEXT.replace("x: 0, v: 5}", "x: {min: 0, max: c}, v: {min: 4, max: 6}}"))
    texts = ["initial.x~uniform(0, 0.8)", "initial.v~uniform(4, 6)"]
    expected = read(["g=9,10", *texts], 50, 3).values(0, 100)
    found = box.sweep(["g=9,10"], tmp_path / "box", random=50, seed=3)
    assert [found[name].tolist() for name in expected] == [column.tolist() for column in expected.values()]
    run = box.simulate(
        initial={"x": float(found["initial.x"][7]), "v": float(found["initial.v"][7])}, parameters={"g": 9}
    )
    assert run.final.state["x"] == found["final.x"][7]
    fixed = box.sweep({"initial.x": [0.1, 0.2]}, tmp_path / "fixed", initial={"v": 5})
    assert [item["name"] for item in fixed.as_json()["vary"]] == ["initial.x"]
    with pytest.raises(UsageError, match="the number of draws is missing"):
        box.sweep(["c=0.7,0.8"], tmp_path / "none")


def test_a_run_says_that_it_took_the_centre_of_a_box():
    box = hsdsl.loads(TEXT.replace("x: 0, v: 5}", "x: 0, v: {min: 4, max: 6}}"))
    run = box.simulate()
    assert run.final.state == hsdsl.loads(TEXT).simulate().final.state
    (warning,) = run.warnings
    assert warning.code == "HS707" and "v from 4 to 6" in warning.message and "centre" in warning.message
