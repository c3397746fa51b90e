"""YAML to nodes: the core rules of 1.2, places, caps."""

import time

import pytest

from hsdsl.base.errors import Findings, ModelError, UsageError
from hsdsl.base.limits import DEFAULT
from hsdsl.language.diagnosis.yaml_text import Faults
from hsdsl.language.files import read_bytes
from hsdsl.language.source import Composer, Mapping, Scalar, Sequence, decode


def root(text):
    findings = Findings("m.yaml")
    text = decode("m.yaml", text if isinstance(text, bytes) else text.encode())
    node = Composer(text, Faults(findings)).document()
    findings.raise_if_any()
    return node


def codes(text):
    with pytest.raises(ModelError) as raised:
        root(text)
    return [d.code for d in raised.value.diagnostics]


KINDS = {
    "on": "text",
    "off": "text",
    "yes": "text",
    "no": "text",
    "y": "text",
    "true": "boolean",
    "False": "boolean",
    "null": "null",
    "~": "null",
    "": "null",
    "1e-3": "number",
    "1e3": "number",
    "010": "number",
    "0x1F": "number",
    "0o17": "number",
    ".5": "number",
    "5.": "number",
    "-.inf": "number",
    ".nan": "number",
    "1_000": "text",
    "0b11": "text",
    "12:30": "text",
    "2020-01-01": "text",
    "'1'": "text",
    '"true"': "text",
}


@pytest.mark.parametrize(("written", "kind"), KINDS.items())
def test_core_schema(written, kind):
    assert root(f"a: {written}").entries["a"][1].kind == kind


def test_numbers_keep_every_digit():
    assert root("a: 0.10000000000000000000000000000000000000001").entries["a"][1].value.endswith("001")


@pytest.mark.parametrize(
    ("text", "start", "end", "place"),
    [
        ("a: x + y", 4, 5, (1, 8, 1)),
        ("a: 'x + y'", 4, 5, (1, 9, 1)),
        ("a: 'it''s y'", 5, 6, (1, 11, 1)),
        (r'a: "\x41 + y"', 4, 5, (1, 12, 1)),
        ("a: {b: x + y}", 0, 5, (1, 8, 5)),
        ("a: |\n  x\n  + y\n", 4, 5, (3, 5, 1)),
        ("a: >\n  x\n  + y\n", 4, 5, (3, 5, 1)),
        ("a: x\n  + y\n", 4, 5, (2, 5, 1)),
        ("é: x + é", 4, 5, (1, 8, 1)),
        ("a:\r\n  b: x + y\r\n", 4, 5, (2, 10, 1)),
    ],
)
def test_places_inside_values(text, start, end, place):
    node = root(text)
    while isinstance(node, Mapping):
        node = next(iter(node))[1]
    span = node.span(start, end)
    assert (span.line, span.column, span.length) == place


def test_keys_and_lists_have_places():
    node = root("a: 1\nbb:\n  - x\n  - {c: 2}\n")
    key, value = node.entries["bb"]
    assert key.place.span.line == 2 and key.place.span.length == 2
    assert isinstance(value, Sequence)
    assert value.items[1].entries["c"][0].place.span.column == 6


def test_aliases_repeat_and_merge_keys_are_plain():
    node = root("a: &a {x: 1}\nb: *a\n<<: *a\n")
    assert node.entries["b"][1] is node.entries["a"][1]
    assert "x" not in node.entries


def test_keys_are_one_spelling():
    assert codes("é: 1\ne\u0301: 2\n") == ["HS008"]


def test_caps():
    assert root("a: " + "[" * 63 + "]" * 63)
    assert codes("a: " + "[" * 64 + "]" * 64) == ["HS014"]
    assert codes("[" * 100_000) == ["HS014"]
    assert codes("- " * 50_000 + "x") == ["HS014"]
    assert codes(b"#" * (DEFAULT.bytes + 1)) == ["HS003"]
    assert codes("a:\n" + "- x\n" * 200_001) == ["HS015"]
    lists = (f"b{i + 1}: &b{i + 1} [{', '.join([f'*b{i}'] * 50)}]\n" for i in range(4))
    assert codes("b0: &b0 [x, x]\n" + "".join(lists)) == ["HS015"]


def test_nesting_counts_inside_aliases():
    half = "[" * 40 + "]" * 40
    assert codes(f"a: &a {half}\nb: {'[' * 40}*a{']' * 40}\n") == ["HS014"]


@pytest.mark.parametrize("text", ["", "# only\n", "\n\n", "---\n# x\n"])
def test_empty(text):
    if text.startswith("---"):
        assert isinstance(root(text), Scalar)  # a document with nothing in it; the schema refuses it
    else:
        assert codes(text) == ["HS011"]


def test_files_that_cannot_be_read(tmp_path):
    for path in (tmp_path / "no.yaml", tmp_path, "x" * 5000, "a\0b"):
        with pytest.raises(UsageError):
            read_bytes(path)


def test_pieces_that_never_close_are_read_in_no_time():
    began = time.process_time()
    root("a: [" + "min(1, " * 20_000 + "2]")
    assert time.process_time() - began < 5


def test_a_saved_run_is_no_model():
    with pytest.raises(ModelError) as raised:
        decode("run.npz", b"PK\x03\x04...")
    (fault,) = raised.value.diagnostics
    assert "archive" in fault.message and "hsdsl.store.load" in (fault.hint or "")
