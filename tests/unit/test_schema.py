"""The JSON Schema: up to date, draft 7, described, and in agreement with what is read."""

import json
from pathlib import Path

import jsonschema
import pytest
import yaml

import hsdsl
from hsdsl.base.errors import ModelError
from hsdsl.language.elaborate import elaborate
from hsdsl.language.schema.jsonschema import json_schema

ROOT = Path(__file__).parent.parent.parent
MODELS = [*ROOT.glob("models/*.yaml")]
MODELS += [p for p in ROOT.glob("tests/conformance/cases/*.yaml") if not p.name.endswith(".expect.yaml")]
BASE = {"hsdsl": 1, "modes": {"A": {"flow": {"x": 1}}}, "initial": {"mode": "A", "x": 0}, "experiment": {"until": 1}}


def parts(schema):
    """Every schema in a schema that stands for a key's value."""
    yield from schema.get("properties", {}).items()
    for part in schema.get("definitions", {}).values():
        yield from parts(part)


def test_the_written_schema_is_up_to_date():
    written = (ROOT / "schemas" / "model.schema.json").read_text(encoding="utf-8")
    assert json.loads(written) == json_schema()


def test_it_is_a_draft_7_schema():
    schema = json_schema()
    jsonschema.Draft7Validator.check_schema(schema)
    text = json.dumps(schema)
    assert "$defs" not in text and "prefixItems" not in text and "unevaluated" not in text
    assert text.count('"$schema"') == 1


def test_nothing_stands_beside_a_reference():
    def check(part):
        if isinstance(part, dict):
            assert "$ref" not in part or len(part) == 1
            for value in part.values():
                check(value)
        elif isinstance(part, list):
            for value in part:
                check(value)

    check(json_schema())


def test_every_key_is_described():
    for name, prop in parts(json_schema()):
        assert prop.get("description", "").endswith("."), name


def test_every_key_has_examples_that_fit_it():
    schema = json_schema()
    for name, prop in parts(schema):
        assert prop.get("examples"), name
        here = {**prop, "definitions": schema["definitions"]}
        for example in prop["examples"]:
            assert list(jsonschema.Draft7Validator(here).iter_errors(example)) == [], (name, example)


def test_hover_and_completion_find_every_key_of_a_transition():
    """What an editor does: follow the schema down a path, and offer the properties it finds there."""
    schema = json_schema()

    def resolved(part):
        reference = part.get("$ref") or next((p["$ref"] for p in part.get("allOf", []) if "$ref" in p), None)
        return schema["definitions"][reference.rsplit("/", 1)[1]] if reference else part

    mode = resolved(schema["properties"]["modes"]["additionalProperties"])
    transition = resolved(mode["properties"]["transitions"]["items"])
    of_events = {"event", "delay", "values", "persistent", "initially", "waiting"}
    assert set(transition["properties"]) == {"when", "if", "to", "reset", "name", "priority"} | of_events
    assert transition["anyOf"] == [{"required": ["when", "to"]}, {"required": ["event"]}]
    assert "surface" in transition["properties"]["when"]["description"]


@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_models_are_valid(path):
    document = yaml.load(path.read_text(encoding="utf-8"), yaml.BaseLoader)
    document["hsdsl"] = 1
    for mode in document["modes"].values():
        if "final" in mode:
            mode["final"] = mode["final"] == "true"
        for transition in mode.get("transitions", []):
            transition |= {key: transition[key] == "true" for key in ("persistent", "initially") if key in transition}
        for transition in mode.get("transitions", []):
            if "priority" in transition:
                transition["priority"] = int(transition["priority"])
    jsonschema.Draft7Validator(json_schema()).validate(document)


CHANGES = [
    ({"parameters": {"a": {"value": 1, "unit": "m", "min": 0, "about": "b"}}}, True),
    ({"parameters": None, "outputs": None, "let": {}, "reference": []}, True),
    ({"inputs": {"u": {"times": [0, 1], "values": [1, "2/3"], "hold": "linear"}}}, True),
    ({"reference": {"states": [{"time": 1, "x": 1}]}}, True),
    ({"reference": [{"transitions": []}, {"trust": 1e-9}]}, True),
    ({"experiment": {"until": "2*pi", "samples": [0, 1]}}, True),
    ({"experiment": {"until": 1, "samples": 5}}, True),
    ({"modes": {"A": {"flow": {"x": 1}, "transitions": None, "domain": None, "final": True}}}, True),
    ({"hsdsl": 2}, False),
    ({"parmeters": {}}, False),
    ({"parameters": {"a": {"unit": "m"}}}, False),
    ({"inputs": {"u": {"times": [0, 1], "values": [1, 2], "hold": "cubic"}}}, False),
    ({"modes": {"A": {"flow": {"x": 1}, "transitions": [{"when": "x >= 1"}]}}}, False),
    ({"modes": {"A": {"flow": {"x": 1}, "final": "yes"}}}, False),
    ({"modes": []}, False),
    ({"initial": {"x": 0}}, False),
    ({"experiment": {}}, False),
    ({"experiment": {"until": 1, "scheme": "fast"}}, False),
]


@pytest.mark.parametrize(("change", "fits"), CHANGES)
def test_schema_and_reader_agree(change, fits):
    document = {**BASE, **change}
    assert jsonschema.Draft7Validator(json_schema()).is_valid(document) is fits
    try:
        elaborate("m.yaml", text=yaml.dump(document).encode())
        read = True
    except ModelError:
        read = False
    assert read is fits


ONE_FAULT = {"events: x > 3": "HS201", "trigger: x > 3": "HS201", "event: {x: 3}": "HS203"}


@pytest.mark.parametrize("event", ONE_FAULT)
def test_a_faulty_event_lacks_no_other_key(event):
    edge = f"{{name: e, {event}, delay: 1, reset: {{x: 0}}}}"
    text = f"hsdsl: 1\nmodes: {{m: {{flow: {{x: 1}}, transitions: [{edge}]}}}}\n"
    with pytest.raises(hsdsl.ModelError) as error:
        hsdsl.loads(text + "initial: {mode: m, x: 0}\nexperiment: {until: 1}\n")
    assert [d.code for d in error.value.diagnostics] == [ONE_FAULT[event]]


@pytest.mark.parametrize("entry", ["solve: [a == 2]", "functions: {f: 2*x}"])
def test_a_value_of_the_wrong_kind_lacks_no_keys(entry):
    text = (
        f"hsdsl: 1\nmodes: {{m: {{flow: {{x: 1}}}}}}\n{entry}\ninitial: {{mode: m, x: 0}}\nexperiment: {{until: 1}}\n"
    )
    with pytest.raises(hsdsl.ModelError) as error:
        hsdsl.loads(text)
    assert [d.code for d in error.value.diagnostics] == ["HS203"]
