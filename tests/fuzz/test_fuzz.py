"""Inputs that mean harm are refused or read, and do nothing: a short campaign, and everything that once broke."""

import random
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fuzz import campaign, seeds, targets

CRASHES = sorted((Path(__file__).parent / "crashes").iterdir())
LIMITS = dict(deadline=None, suppress_health_check=list(HealthCheck))


@pytest.fixture(scope="module")
def guard(tmp_path_factory):
    return targets.Guard(targets.prepared(tmp_path_factory.mktemp("fuzz")))


def fed(guard, kind, data, share=1.0):
    with guard.watch():
        return targets.feed(kind, data, random.Random(0), Path(guard.folder), share)


@pytest.mark.parametrize("path", CRASHES, ids=lambda path: path.stem)
def test_what_once_broke(guard, path):
    kind = "documents" if path.suffix == ".yaml" else "expressions"
    data = path.read_bytes() if kind == "documents" else path.read_text(encoding="utf-8").rstrip("\n")
    with campaign.limited_time():
        fed(guard, kind, data)


@pytest.mark.parametrize("kind", campaign.KINDS)
def test_a_short_campaign(guard, kind):
    for index in range(400):
        data, rng = campaign.of_index(kind, 0, index)
        with guard.watch():
            targets.feed(kind, data, rng, Path(guard.folder), 0.05)


@pytest.mark.campaign
@pytest.mark.parametrize("kind", campaign.KINDS)
def test_a_longer_campaign(kind):
    result = campaign.run(campaign.parsed(["--kind", kind, "--inputs", "5000", "--seed", "7"]))
    assert result["inputs"] == 5_000
    assert campaign.distinct(result["faults"]) == []


@settings(max_examples=150, **LIMITS)
@pytest.mark.parametrize("kind", campaign.KINDS)
@given(rng=st.randoms(use_true_random=False))
def test_any_input(guard, kind, rng):
    fed(guard, kind, campaign.KINDS[kind](rng), 0.3)


PLACES = {
    "a flow": "flow: {x: HERE}",
    "a guard": "flow: {x: 1}\n    transitions: [{when: HERE, to: A}]",
    "a condition": "flow: {x: 1}\n    transitions: [{when: x >= 1, if: HERE, to: A}]",
    "a reset": "flow: {x: 1}\n    transitions: [{when: x >= 1, to: A, reset: {x: HERE}}]",
    "a target": "flow: {x: 1}\n    transitions: [{when: x >= 1, to: HERE}]",
    "a name of a transition": "flow: {x: 1}\n    transitions: [{when: x >= 1, to: A, name: HERE}]",
    "a wall": "flow: {x: 1}\n    domain: [HERE]",
    "a definition": "flow: {x: 1}\n    let: {w: HERE}",
    "a key of a flow": "flow: {x: 1, HERE: 1}",
}


@pytest.mark.parametrize("quoted", [False, True], ids=["plain", "quoted"])
@pytest.mark.parametrize("place", PLACES)
def test_no_payload_runs_anywhere(guard, place, quoted):
    for payload in seeds.PAYLOADS:
        text = "'" + payload.replace("'", "''") + "'" if quoted else payload
        body = PLACES[place].replace("HERE", text)
        model = f"hsdsl: 1\nmodes:\n  A:\n    {body}\ninitial: {{mode: A, x: 0}}\nexperiment: {{until: 1}}\n"
        fed(guard, "documents", model.encode())


@pytest.mark.parametrize("name", seeds.NAMES)
def test_names_reach_no_generator(guard, name):
    model = f"""hsdsl: 1
parameters: {{"{name}_": 2}}
let: {{"{name}__": "{name}_ + 1"}}
modes:
  "{name}":
    flow: {{"{name}": "{name}_ - {name}__"}}
    transitions: [{{when: "{name} >= 1", to: "{name}", name: "{name}", reset: {{"{name}": 0}}}}]
outputs: {{"{name}___": "2*{name}"}}
initial: {{mode: "{name}", "{name}": 0}}
experiment: {{until: 1}}
"""
    way = fed(guard, "documents", model.encode())
    assert way == ("refused" if name in ("t", "pi", "mode") or not name.isidentifier() else "run")


def test_the_guard_sees_what_it_should(guard):
    """What the other tests rely on."""
    for deed in (
        lambda: (Path(guard.folder) / "made").write_text("x"),
        lambda: Path("/etc/passwd").read_text(),
        lambda: (Path(guard.folder) / "link.csv").read_text(),
        lambda: eval("1 + 1"),
        lambda: __import__("os").system("true"),
        lambda: __import__("subprocess").run(["true"]),
    ):
        with pytest.raises(targets.Violation), guard.watch():
            deed()
    with pytest.raises(targets.Violation):
        targets.check_text("def bind(x0):\n    return __import__\n")
    with pytest.raises(campaign.Hang), campaign.limited_time(0.05):
        while True:
            pass
