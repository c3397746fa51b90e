"""Arguments that are none: refused in a sentence, not by an exception from below."""

from __future__ import annotations

import inspect
import os
import pkgutil
import re
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from shipped import MODELS

import hsdsl
from hsdsl.analysis.plot import plot
from hsdsl.analysis.store import save
from hsdsl.base.errors import UsageError
from hsdsl.base.names import INVISIBLE

BALL = MODELS / "bouncing-ball.yaml"
NUMBERS = [float("nan"), float("inf"), 1.5, "2", True, 0, -1, None, [1]]


@pytest.mark.parametrize("every", NUMBERS)
def test_every(every, tmp_path):
    with pytest.raises(UsageError, match="every must be"):
        hsdsl.load(BALL).stream(tmp_path / "x.csv", every=every)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("threads", [number for number in NUMBERS if number is not None])
def test_threads(threads):
    with pytest.raises(UsageError, match="threads must be"):
        hsdsl.load(BALL).ensemble(threads=threads)


@pytest.mark.parametrize("times", [number for number in NUMBERS if number not in (0, True)] + [True])
def test_transition_times(times):
    with pytest.raises(UsageError, match="transition_times must be"):
        hsdsl.load(BALL).ensemble(transition_times=times)


def test_whole_numbers_of_numpy_are_whole_numbers():
    many = hsdsl.load(BALL).ensemble(threads=np.int64(1), transition_times=np.int32(2))
    assert many.transition_times.shape == (2,)


def test_masked_elements_are_no_values():
    heights = np.ma.masked_array([1.0, 2.0, 3.0], mask=[False, True, False])
    with pytest.raises(UsageError, match="masked"):
        hsdsl.load(BALL).ensemble(initial={"h": heights})
    whole = hsdsl.load(BALL).ensemble(initial={"h": np.ma.masked_array([1.0, 2.0], mask=False)}, until=0.1)
    assert whole.shape == (2,)


@pytest.mark.parametrize("name", ["=1+1", "+x", "-x", "@x", "=cmd|'/c'!A1"])
def test_no_cell_is_a_formula(name, tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text(
        f'hsdsl: 1\nmodes: {{"{name}": {{flow: {{x: -1}}}}}}\ninitial: {{mode: "{name}", x: -1}}\n'
        "experiment: {until: 1}\n"
    )
    save(hsdsl.load(path).simulate(), tmp_path / "run.csv")
    cells = [line.split(",") for line in (tmp_path / "run.csv").read_text().splitlines()[1:]]
    assert {row[1] for row in cells} == {"'" + name} and {row[3][0] for row in cells} == {"-"}


@pytest.mark.parametrize("sign", ["\u061c", "\u00ad", "\u200f", "\u202e"])
def test_signs_without_width_are_invisible(sign):
    assert re.search(INVISIBLE, f"a{sign}b")


def test_pictures_are_the_same_from_any_thread(tmp_path):
    run = hsdsl.load(BALL).simulate(engine="python")
    threads = [threading.Thread(target=plot, args=(run, tmp_path / f"{k}.svg")) for k in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({(tmp_path / f"{k}.svg").read_bytes() for k in range(6)}) == 1


@pytest.mark.parametrize("named", ["nonsense", "module://no.such.module", ""])
def test_any_backend_of_matplotlib_may_be_named(named, tmp_path):
    command = [sys.executable, "-m", "hsdsl", "run", str(BALL), "-q", "--engine", "python", "--plot", "x.svg"]
    environment = {**os.environ, "MPLBACKEND": named}
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
    assert (tmp_path / "x.svg").stat().st_size > 1000


def test_times_of_samples_in_no_order_have_a_place():
    text = """hsdsl: 1
parameters: {T: 1.25}
inputs:
  pulse: {times: [0, T, 2*T, 3], values: [0, 1, 0, 2], hold: zero}
modes: {a: {flow: {x: pulse}}}
initial: {mode: a, x: 0}
experiment: {until: 4}
"""
    model = hsdsl.loads(text)
    model.simulate()
    with pytest.raises(UsageError, match=r"<text>:4:30: .* pulse do not increase: 3\.0 after 3\.5") as refused:
        model.simulate(parameters={"T": 1.75})
    assert refused.value.hint == "give each time once, the earliest first"


sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
RUN = hsdsl.load(BALL).simulate(until=0.1)
HANDED_ON = {  # functions with `**arguments`; of orbits, fits and sweeps see their own tests
    "Model.simulate": hsdsl.load(BALL).simulate,
    "Model.ensemble": hsdsl.load(BALL).ensemble,
    "Model.stream": lambda **unknown: hsdsl.load(BALL).stream("run.csv", **unknown),
    "Model.plot": lambda **unknown: hsdsl.load(BALL).plot(RUN, "picture.png", **unknown),
    "hsdsl.distance": lambda **unknown: hsdsl.distance(RUN, RUN, **unknown),
    "Model.sensitivity": lambda **unknown: hsdsl.load(BALL).sensitivity("c", **unknown),
    "Model.orbit": lambda **unknown: hsdsl.load(BALL).orbit("h = 0", **unknown),
    "Execution.plot": RUN.plot,
    "hsdsl.analysis.plot.plot": lambda **unknown: plot(RUN, "picture.png", **unknown),
    "hsdsl.exact.precise": lambda **unknown: hsdsl.exact.precise(hsdsl.load(BALL), **unknown),
}


def public_functions():
    """What the page on Python documents and has no `**arguments`, by name."""
    from writing.python_api import MADE, SECTIONS

    for name, members in (pair for pairs in SECTIONS.values() for pair in pairs):
        thing, last = pkgutil.resolve_name(name), name.rpartition(".")[2]
        if not isinstance(thing, type):
            yield name, thing
            continue
        shown = vars(thing) if members == "*" else members.split()
        found = ((key, inspect.getattr_static(thing, key)) for key in shown if not key.startswith("_"))
        yield from ((f"{last}.{key}", value) for key, value in found if inspect.isfunction(value))
        if name in MADE:
            yield name, thing


def named(function):
    """Whether a function has a name for each of its arguments."""
    return inspect.Parameter.VAR_KEYWORD not in [p.kind for p in inspect.signature(function).parameters.values()]


CALLS = {name: function for name, function in public_functions() if named(function)} | HANDED_ON


@pytest.mark.parametrize("name", CALLS)
def test_an_argument_that_does_not_exist_is_a_usage_error(name):
    with pytest.raises(UsageError, match="has no argument 'not_one'"):
        CALLS[name](not_one=1)


@pytest.mark.parametrize(
    ("argument", "hint"),
    [
        ("inputs", "in the file"),
        ("e", "parameters={'e': ...}"),
        ("h", "initial={'h': ...}"),
        ("tolerence", "'tolerance'"),
    ],
)
def test_the_hint_says_where_it_belongs(argument, hint):
    model = hsdsl.load(BALL)
    with pytest.raises(UsageError) as raised:
        model.simulate(**{argument: 1})
    assert hint in str(raised.value.hint)
