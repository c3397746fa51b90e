"""What the page about editors says: modelines lead to the schema, and the patterns match what is printed."""

import json
import re
from pathlib import Path

from hsdsl.base.errors import Diagnostic, Span
from hsdsl.language.diagnose import render
from hsdsl.language.schema.jsonschema import json_schema

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "editors.md").read_text(encoding="utf-8")
MODELINE = re.compile(r"# yaml-language-server: \$schema=(\S+)")


def test_models_begin_with_a_modeline_that_leads_to_the_schema():
    models = sorted((ROOT / "models").glob("*.yaml"))
    assert models
    for path in models:
        modeline = MODELINE.fullmatch(path.read_text(encoding="utf-8").splitlines()[0])
        assert modeline, path.name
        assert json.loads((path.parent / modeline[1]).read_text(encoding="utf-8")) == json_schema()
    assert MODELINE.search(PAGE)[1] == modeline[1]


def test_the_problem_matcher_matches():
    blocks = re.findall(r"^```json\n(.*?)^```$", PAGE, flags=re.MULTILINE | re.DOTALL)
    (pattern,) = [json.loads(b)["problemMatcher"]["pattern"] for b in blocks if "problemMatcher" in b]
    span = Span("models/a b.yaml", 3, 14, 2)
    for severity in ("error", "warning", "note"):
        line = render(Diagnostic("HS111", "nothing here is called 'q'", span, severity=severity)).splitlines()[0]
        found = re.fullmatch(pattern["regexp"], line)
        assert [found[pattern[key]] for key in ("file", "line", "column", "severity", "code", "message")] == [
            *("models/a b.yaml", "3", "14", severity, "HS111", "nothing here is called 'q'")
        ]
