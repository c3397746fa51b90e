"""What a run is given by file, --set and options: the later wins, and step and tolerance exclude each other."""

from __future__ import annotations

import numpy as np
import pytest

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.base.numbers.arithmetic import FLOAT64, multiprecision
from hsdsl.engine.integrators import INTEGRATORS
from hsdsl.engine.preparation.experiment import check_method
from hsdsl.engine.preparation.options import FILE, resolve
from hsdsl.interface.model import split_overrides

# (file, --set, call) -> (method, size, its value)
ACCEPTED = {
    "nothing": (({}, {}, {}), ("dopri5", "tolerance", 1e-9)),
    "file": (({"method": "midpoint", "step": 1}, {}, {}), ("midpoint", "step", 1)),
    "a later step removes a tolerance": (({"tolerance": 1}, {"step": 2}, {}), ("dopri5", "step", 2)),
    "a later tolerance removes a step": (
        ({"method": "dopri5", "step": 1}, {}, {"tolerance": 2}),
        ("dopri5", "tolerance", 2),
    ),
    "a fixed method of the file gives way": (
        ({"method": "rk4", "step": 1}, {}, {"tolerance": 2}),
        ("dopri5", "tolerance", 2),
    ),
    "and to --set": (({"method": "rk4", "step": 1}, {"tolerance": 2}, {}), ("dopri5", "tolerance", 2)),
    "and back again": (({"method": "rk4", "step": 1}, {"tolerance": 2}, {"step": 3}), ("rk4", "step", 3)),
    "call over --set over file": (({"step": 1}, {"step": 2}, {"step": 3}), ("dopri5", "step", 3)),
    "--set over file": (({"step": 1, "method": "euler"}, {"method": "heun"}, {}), ("heun", "step", 1)),
    "auto": (({"step": 1, "method": "euler"}, {}, {"method": "auto"}), ("dopri5", "step", 1)),
    "none is not given": (({"step": 1, "method": "euler"}, {}, {"step": None}), ("euler", "step", 1)),
}
MODEL = "{hsdsl: 1, modes: {a: {flow: {x: 1}}}, initial: {mode: a, x: 0}, experiment: {until: 1}}"
OWN = {"scheme": "paoli-schatzman"}
REFUSED = {
    "both in the file": (({"step": 1, "tolerance": 1}, {}, {}), "both step and tolerance"),
    "both in --set": (({}, {"step": 1, "tolerance": 1}, {}), "both step and tolerance"),
    "both in the call": (({}, {}, {"step": 1, "tolerance": 1}), "both step and tolerance"),
    "explicit method cannot serve the file": (({"tolerance": 1}, {}, {"method": "rk4"}), "cannot keep a tolerance"),
    "explicit method cannot serve the default": (({}, {"method": "rk4"}, {}), "cannot keep a tolerance"),
    "explicit method, later tolerance": (({}, {"method": "rk4"}, {"tolerance": 1}), "cannot keep a tolerance"),
    "file against itself": (({"method": "rk4", "tolerance": 1}, {}, {}), "cannot keep a tolerance"),
    "unknown method": (({}, {}, {"method": "rk5"}), "no method 'rk5'"),
    "unknown scheme": (({}, {}, {"scheme": "relax"}), "no scheme 'relax'"),
    "own formula, explicit method": (({"step": 1}, {}, {**OWN, "method": "rk4"}), "no method"),
    "own formula, --set method": (({**OWN, "step": 1}, {"method": "rk4"}, {}), "no method"),
    "own formula, explicit relaxation": (({"step": 1}, {}, {**OWN, "relaxation": 1}), "no relaxation"),
    "own formula, default tolerance": (({}, {}, OWN), "needs a step"),
    "own formula, tolerance": (({**OWN, "step": 1}, {}, {"tolerance": 1}), "needs a step"),
    "unknown setting": (({}, {"stepp": 1}, {}), "no setting 'stepp'"),
}


def ask(places):
    return resolve(dict(zip((FILE, "--set", "the call"), places, strict=True)))


@pytest.mark.parametrize("case", ACCEPTED)
def test_precedence(case):
    places, (method, size, value) = ACCEPTED[case]
    request = ask(places)
    assert (request.method.name, request.size, float(request.values[request.size].value)) == (method, size, value)


@pytest.mark.parametrize("places", [({}, {}, OWN), (OWN, {}, {}), ({}, OWN, {"method": "auto"})])
def test_a_scheme_with_its_own_formula_takes_no_method(places):
    """What the file says for other schemes gives way."""
    in_file, in_set, call = places
    request = ask(({"step": 1, "method": "rk4", "relaxation": 1, **in_file}, in_set, call))
    assert (request.scheme, request.method, request.size) == ("paoli-schatzman", None, "step")


@pytest.mark.parametrize("case", REFUSED)
def test_refusals(case):
    places, words = REFUSED[case]
    with pytest.raises(UsageError, match=words):
        ask(places)


def test_overrides_are_sorted_and_the_last_counts():
    pairs = ["c=1", "initial.v = 2*c", "experiment.step=1e-3", "initial.mode=free", "c=0.5"]
    assert split_overrides(pairs) == ({"c": "0.5"}, {"v": "2*c", "mode": "free"}, {"step": "1e-3"})


@pytest.mark.parametrize("pair", ["c", "=1", "c=", "initail.c=1", ""])
def test_malformed_overrides(pair):
    with pytest.raises(UsageError):
        split_overrides([pair])


def test_a_method_known_as_decimals_serves_no_more_digits_than_it_has():
    smooth = hsdsl.loads(MODEL).program
    check_method(INTEGRATORS["dop853"], smooth, FLOAT64)
    check_method(INTEGRATORS["dop853"], smooth, multiprecision(25))
    check_method(INTEGRATORS["dopri5"], smooth, multiprecision(1000))
    with pytest.raises(UsageError, match="25 digits, too few for a precision of 26"):
        check_method(INTEGRATORS["dop853"], smooth, multiprecision(26))


def test_samples_may_be_an_array(tmp_path):
    text = "hsdsl: 1\nmodes: {m: {flow: {x: 2}}}\ninitial: {mode: m, x: 0}\nexperiment: {until: 1}\n"
    times = np.linspace(0.25, 1, 4)
    arrays, lists = (hsdsl.loads(text).simulate(samples=given) for given in (times, times.tolist()))
    assert arrays.settings["samples"] == lists.settings["samples"]


EVERY = """
hsdsl: 1
parameters: {rate: 4}
modes: {m: {flow: {x: rate}}}
initial: {mode: m, x: 0}
experiment: {until: 1, samples: {every: 1/rate}}
"""


def test_samples_of_the_file_may_be_multiples_of_a_time():
    model = hsdsl.loads(EVERY)
    assert model.simulate().sample_times.tolist() == [0, 0.25, 0.5, 0.75, 1]
    assert model.simulate(parameters={"rate": 2.5}).sample_times == pytest.approx([0, 0.4, 0.8])
    assert model.simulate(samples=3).sample_times.tolist() == [0, 0.5, 1]
    with pytest.raises(UsageError, match="between samples must be positive"):
        model.simulate(parameters={"rate": -1})
    assert model.sensitivity("initial.x").sample().times.tolist() == [0, 0.25, 0.5, 0.75, 1]
    assert model.sensitivity("rate", samples=2).sample().slopes["x"].tolist() == [[0], [1]]
    with pytest.raises(UsageError, match="may not depend on rate"):
        model.sensitivity("rate")
