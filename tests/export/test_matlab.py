"""Models as MATLAB functions: plain text everywhere, and with GNU Octave the transitions of our own runs."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from export.agreement import assert_agree, by_octave, octave_run, of_run
from export.octave import OCTAVE, evaluated, exported
from shipped import assert_golden

import hsdsl
from hsdsl.errors import UsageError
from hsdsl.export import files_of, source_of

ROOT = Path(__file__).parents[2]
MODELS = sorted((ROOT / "models").glob("*.yaml"))
FIXED, ADAPTIVE = 1e-9, 1e-7  # of times of transitions, relative to the run
LOCATED: dict[str, Any] = {"scheme": "located", "method": "rk4", "step": "1/100"}
RELAXED: dict[str, Any] = {"scheme": "relaxed", "method": "midpoint", "step": "1/100", "relaxation": "1e-3"}
octave = pytest.mark.skipif(OCTAVE is None, reason="octave-cli is not installed: tests/export/install-tools.sh")
SHORT = {
    "oscillator-with-stop-1": {"until": "8"},
    "oscillator-with-stop-2": {"until": "5", "relaxation": "1e-2"},
    "thermostat": {"until": "7"},
    "bouncing-ball": {"until": "6"},
}


def compare(model: Any, folder: Path, tolerance: float, **arguments: Any) -> None:
    assert_agree(of_run(model.simulate(**arguments)), by_octave(model, folder, **arguments), tolerance)


def kept(path: Path, arguments: dict[str, Any]) -> dict[str, Any]:
    return arguments | SHORT.get(path.stem, {})


@pytest.mark.tools
@octave
@pytest.mark.parametrize("arguments", [LOCATED, RELAXED], ids=lambda a: a["scheme"])
@pytest.mark.parametrize("path", [p for p in MODELS if p.stem != "stiff-switch"], ids=lambda p: p.stem)
def test_fixed_steps_make_our_transitions(path: Path, arguments: dict[str, Any], tmp_path: Path) -> None:
    compare(hsdsl.load(path), tmp_path, FIXED, **kept(path, arguments))


@pytest.mark.tools
@octave
@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_settings_of_the_file_make_our_transitions(path: Path, tmp_path: Path) -> None:
    shorter = SHORT | {"oscillator-with-stop-1": {"until": "3"}, "thermostat": {}, "bouncing-ball": {}}
    compare(hsdsl.load(path), tmp_path, ADAPTIVE, **shorter.get(path.stem, {}))


@pytest.mark.tools
@octave
def test_a_ball_comes_to_rest(tmp_path: Path) -> None:
    compare(hsdsl.load(ROOT / "models/bouncing-ball.yaml"), tmp_path, FIXED, **LOCATED | {"until": "14"})


HOSTILE = """
hsdsl: 1
title: "it's %{ \\" ... 'quoted' \\\\n %d"
parameters: {end: 9.81, if: {value: 1/2, about: "it's 50% ..."}, d: 2*if, θ: 1, w0: d/4}
inputs: {u: {times: [0, 1, 2], values: [0, 1, 0], hold: zero}, s: {times: [0, 3], values: [0, 3], hold: linear}}
modes:
  "it's%": {flow: {p: x, x: "-end + u*θ + 0*s", out: 1, i: sign(t - 1)*w0}, transitions: [
    {name: "b'n%d", when: p <= 0, if: x < 0 and (out > 0 or i > 5), to: "it's%", reset: {x: -if*x}},
    {when: out >= 3/2, to: other, priority: 2, reset: {m: sqrt(abs(x)) + d**2}}]}
  other: {flow: {m: "max(m, 1)*asin(1/2) - s"}, domain: [m <= 1000]}
initial: {mode: "it's%", p: 20*w0, x: 0, out: 0, i: 0}
experiment: {until: 2}
"""


@pytest.mark.tools
@octave
@pytest.mark.parametrize("reset", ["select(v, v, -0.3*v)", "max(-0.4*v, 0)", "abs(v)/3"])
def test_a_body_rests_where_its_reset_has_kinks(reset: str, tmp_path: Path) -> None:
    model = hsdsl.loads(
        "hsdsl: 1\nmodes: {m: {flow: {x: v, v: -3}, transitions: [{when: x <= 0, to: m, "
        f"reset: {{v: '{reset}'}}}}]}}}}\n"
        "initial: {mode: m, x: 1, v: 0}\nexperiment: {until: 4}\n"
    )
    compare(model, tmp_path, ADAPTIVE)


@pytest.mark.tools
@octave
def test_names_and_texts_of_a_model_are_only_that(tmp_path: Path) -> None:
    compare(hsdsl.loads(HOSTILE), tmp_path, FIXED, **LOCATED)


@pytest.mark.tools
@octave
def test_parameters_change_and_others_follow(tmp_path: Path) -> None:
    model = hsdsl.loads(HOSTILE)
    name = exported(model, tmp_path, **LOCATED)
    chosen = f"p = {name}_parameters('if_', 0.7);"
    text = evaluated(tmp_path, f"{chosen} fprintf('%.17g ', p.d, p.w0, {name}_initial(p));")
    assert [float(v) for v in text.split()] == [1.4, 0.35, 1, 7, 0, 0, 0]
    ours = model.simulate(**LOCATED, parameters={"if": "0.7"})
    assert_agree(of_run(ours), octave_run(tmp_path, f"{chosen} r = {name}_run(p);"), FIXED)
    text = evaluated(tmp_path, f"try, {name}_parameters('q', 1); catch e, disp(e.message); end")
    assert text.strip() == "there is no parameter q"


SETS = """
r = NAME_run();
bad = 0;
for k = 1:numel(r.t)
  x = r.x(k, :).';
  bad = bad + ~(NAME_C(x, r.t(k), r.j(k)) || NAME_D(x, r.t(k), r.j(k)));
end
for k = 1:numel(r.transitions)
  e = r.transitions(k);
  x = zeros(size(r.x, 2), 1);
  x(1) = find(strcmp(m.mode_names, e.source));
  x(2:numel(e.before) + 1) = e.before;
  after = NAME_g(x, e.time, k);
  bad = bad + ~NAME_D(x, e.time, k) + (norm(after(2:numel(e.after) + 1) - e.after) > 1e-12);
  bad = bad + ~strcmp(m.mode_names{after(1)}, e.target);
end
dx = NAME_f(r.x(2, :).', r.t(2), 0);
fprintf('%d %d ', bad, numel(r.transitions));
fprintf('%.17g ', dx);
"""


@pytest.mark.tools
@octave
@pytest.mark.parametrize("stem", ["bouncing-ball", "constrained-pendulum", "thermostat"])
def test_sets_and_maps_fit_the_run(stem: str, tmp_path: Path) -> None:
    model = hsdsl.load(ROOT / f"models/{stem}.yaml")
    name = exported(model, tmp_path)
    bad, count, *slope = evaluated(tmp_path, f"m = {name}_model();" + SETS.replace("NAME", name)).split()
    assert (int(bad), int(count)) == (0, len(model.simulate().transitions))
    assert float(slope[0]) == 0 and any(float(v) for v in slope[1:])


@cache
def texts(text: str) -> dict[str, str]:
    files = files_of(source_of(hsdsl.loads(text), {}), "matlab")
    return {name: content.decode() for name, content in files.items()}


def test_files_are_functions_of_their_names_in_plain_matlab() -> None:
    for name, text in texts(HOSTILE).items():
        if not name.endswith(".m"):
            continue
        assert re.match(rf"function (\w+ = )?{name[:-2]}\b", text)
        code = re.sub(r"'(?:[^'\n]|'')*'|%.*", "", text)  # without strings and comments; no transpose is left
        assert not re.search(r"\"|!|#|\+=|\bprintf\b|\bendfunction\b|\bendif\b|\bunwind_protect\b", code), name
        opened = len(re.findall(r"^\s*(?:function|if|for|while|try)\b", code, re.MULTILINE))
        assert opened == len(re.findall(r"^\s*end\b", code, re.MULTILINE)), name
        assert all(len(word) <= 63 for word in re.findall(r"\w+", code))


def test_text_of_the_model_stays() -> None:
    model = hsdsl.load(ROOT / "models/thermostat.yaml")
    files = files_of(source_of(model, {}), "matlab")
    found = "".join(files[f"thermostat_{part}.m"].decode() for part in ("model", "parameters", "initial", "D"))
    found = "".join(line for line in found.splitlines(keepends=True) if not line.startswith(("% Generated", "% model")))
    assert_golden(found, Path(__file__).parent / "golden" / "thermostat.matlab.txt")


def test_what_the_driver_lacks_is_refused(tmp_path: Path) -> None:
    model = hsdsl.load(ROOT / "models/oscillator-with-stop-1.yaml")
    with pytest.raises(UsageError, match="no scheme paoli-schatzman"):
        files_of(source_of(model, {"scheme": "paoli-schatzman", "step": "1e-3"}), "matlab")
    long = tmp_path / f"{'a' * 120}.yaml"
    long.write_text((ROOT / "models/thermostat.yaml").read_text())
    assert max(map(len, files_of(source_of(hsdsl.load(long), {}), "matlab"))) < 63
