"""Models as MATLAB functions: plain text everywhere, and with GNU Octave the transitions of our own runs."""

from __future__ import annotations

import os
import re
import subprocess
from functools import cache
from pathlib import Path
from shutil import which
from typing import Any

import pytest
from export.c_builds import COMPILERS, cached_compiler
from export.octave import OCTAVE, assert_runs, evaluated, exported
from shipped import assert_golden

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.export import files_of, source_of
from hsdsl.export.c import EXACT_FLAGS

ROOT = Path(__file__).parents[2]
CASES = [f"tests/conformance/{name}" for name in ("cases", "events", "parts")]
octave = pytest.mark.skipif(OCTAVE is None, reason="octave-cli is not installed: tests/export/install-tools.sh")
EVERY = [
    pytest.param(path, marks=[pytest.mark.slow] if folder != "models" else [], id=f"{path.parent.name}-{path.stem}")
    for folder in ("models", "models/gallery", "models/parts", *CASES)
    for path in sorted((ROOT / folder).glob("*.yaml"))
    if ".expect" not in path.name
]
LOCATED: dict[str, Any] = {"scheme": "located", "method": "rk4", "step": "1/100"}
RELAXED: dict[str, Any] = {"scheme": "relaxed", "method": "midpoint", "step": "1/100", "relaxation": "1e-3"}
ADAPTIVE: dict[str, Any] = {"scheme": "relaxed", "method": "dopri5", "tolerance": 1e-7}


@pytest.mark.tools
@octave
@pytest.mark.parametrize("path", EVERY)
def test_every_model_and_every_case_runs_as_it_does_here(path: Path, tmp_path: Path) -> None:
    assert_runs(hsdsl.load(path), tmp_path)


@pytest.mark.tools
@octave
@pytest.mark.parametrize("arguments", [LOCATED, RELAXED, ADAPTIVE], ids=["located", "relaxed", "adaptive"])
@pytest.mark.parametrize("name", ["bouncing-ball", "digital-control", "thermostat"])
def test_other_schemes_and_methods(name: str, arguments: dict[str, Any], tmp_path: Path) -> None:
    assert assert_runs(hsdsl.load(ROOT / f"models/{name}.yaml"), tmp_path, **arguments).transitions


@pytest.mark.tools
@octave
@pytest.mark.parametrize(("export", "scheme"), [("located", "relaxed"), ("relaxed", "located")])
def test_settings_of_a_run_change(export: str, scheme: str, tmp_path: Path) -> None:
    model, method = hsdsl.load(ROOT / "models/bouncing-ball.yaml"), {"method": "dopri5", "relaxation": 1e-3}
    statement = f"""m = NAME_model(); s = m.settings; s.scheme = '{scheme}'; s.until = 13; s.tolerance = 1e-6;
      s.max_transitions = 9; r = hsdsl_simulate(m, NAME_parameters(), NAME_initial(NAME_parameters()), s);"""
    given = {"scheme": scheme, "until": 13, "tolerance": 1e-6, "max_transitions": 9}
    run = assert_runs(model, tmp_path, statement, given, **method, scheme=export)
    assert run.stop.reason == "transition_limit"


REFUSED = """
m = NAME_model(); p = NAME_parameters(); x0 = NAME_initial(p);
function tried(m, p, x0, varargin)
  s = m.settings;
  for k = 1:2:numel(varargin), s.(varargin{k}) = varargin{k + 1}; end
  try, hsdsl_simulate(m, p, x0, s); catch e, disp([e.identifier ' ' e.message]); end
end
tried(m, p, [3; 0]); tried(m, p, 1); tried(m, p, x0, 'scheme', 'exact'); tried(m, p, x0, 'step', 1);
tried(m, p, x0, 'until', 99); tried(m, p, NaN * x0); tried(m, p, [1; NaN]); tried(m, p, x0, 'relaxation', 0);
"""


@pytest.mark.tools
@octave
def test_what_has_no_meaning_is_refused(tmp_path: Path) -> None:
    model = hsdsl.loads(
        "hsdsl: 1\ninputs: {u: {times: [0, 1], values: [1, 2], hold: zero}}\nmodes: {m: {flow: {x: u}}}\n"
        "initial: {mode: m, x: 0}\nexperiment: {until: 4}\n"
    )
    name = exported(model, tmp_path)
    lines = evaluated(tmp_path, REFUSED.replace("NAME", name)).splitlines()
    words = ["mode", "initial", "scheme", "step", "until", "mode", "numbers", "numbers"]
    assert [line.partition(" ")[0] for line in lines] == [f"hsdsl:{word}" for word in words]
    assert not list(tmp_path.glob("*.mex"))


NO_MEX = "warning('off', 'all'); addpath(fullfile(pwd, 'none')); "


@pytest.mark.tools
@octave
def test_without_mex_files_a_program_is_compiled_and_called(tmp_path: Path) -> None:
    tmp_path /= "it's $(false) here"
    (tmp_path / "none").mkdir(parents=True)
    lacking = "function [output, status] = mkoctfile(varargin)\n  output = 'no octave-dev';\n  status = 1;\nend\n"
    (tmp_path / "none" / "mkoctfile.m").write_text(lacking)
    model = hsdsl.load(ROOT / "models/thermostat.yaml")
    assert_runs(model, tmp_path, f"{NO_MEX} r = NAME_run();")
    assert list(tmp_path.glob("*.exe")) and not list(tmp_path.glob("*.mex"))
    (program,) = tmp_path.glob("*.exe")
    program.unlink()
    command = re.search(r"    cc .*?-lm\n", (tmp_path / "README.md").read_text(), re.DOTALL)
    assert command is not None
    (tmp_path / "none" / "cc").write_text(f'#!/bin/sh\nexec {cached_compiler()} "$@"\n')
    (tmp_path / "none" / "cc").chmod(0o700)
    found = {"PATH": f"{tmp_path / 'none'}:{os.environ['PATH']}", "HSDSL_TESTS_CC": which("cc") or "cc"}
    subprocess.run(["bash", "-ec", command[0]], cwd=tmp_path, check=True, env={**os.environ, **found})
    assert_runs(model, tmp_path, f"{NO_MEX} r = NAME_run();")
    program.unlink()
    tried = f"{NO_MEX} try, thermostat_run(); catch e, disp(e.message); end"
    found = evaluated(tmp_path, tried, CC="false")
    assert found.startswith("expected a C compiler for MEX files or programs: no octave-dev")


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_program_compiles_without_warnings(compiler: str, tmp_path: Path) -> None:
    exported(hsdsl.load(ROOT / "models/thermostat.yaml"), tmp_path)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-DGATEWAY_PROGRAM", "-Ic", "-Ic/runtime"]
    sources = [f"c/{name}" for name in ("gateway.c", "instance.c")]
    command = [*COMPILERS[compiler], *flags, *EXACT_FLAGS, "-c", *sources]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


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
def test_names_and_texts_of_a_model_are_only_that(tmp_path: Path) -> None:
    assert_runs(hsdsl.loads(HOSTILE), tmp_path, **LOCATED)


@pytest.mark.tools
@octave
def test_parameters_change_and_others_follow(tmp_path: Path) -> None:
    model = hsdsl.loads(HOSTILE)
    name = exported(model, tmp_path, **LOCATED)
    chosen = f"p = {name}_parameters('if_', 0.7);"
    text = evaluated(tmp_path, f"{chosen} fprintf('%.17g ', p.d, p.w0, {name}_initial(p));")
    assert [float(v) for v in text.split()] == [1.4, 0.35, 1, 7, 0, 0, 0]
    assert_runs(model, tmp_path, f"{chosen} r = NAME_run(p);", {"parameters": {"if": "0.7"}}, **LOCATED)
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
  x(1) = max([1, find(strcmp(m.mode_names, e.source))]);
  x(2:numel(e.before) + 1) = e.before;
  after = NAME_g(x, e.time, k);
  bad = bad + ~NAME_D(x, e.time, k) + (norm(after(2:numel(e.after) + 1) - e.after) > 1e-12);
  bad = bad + ~(any(strcmp(m.mode_names{after(1)}, e.target)) || numel(m.part_names) > 0);
end
dx = NAME_f(r.x(2, :).', r.t(2), 0);
fprintf('%d %d ', bad, numel(r.transitions));
fprintf('%.17g ', dx);
"""


@pytest.mark.tools
@octave
@pytest.mark.parametrize("stem", ["bouncing-ball", "constrained-pendulum", "thermostat", "parts/rooms"])
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
        opened = len(re.findall(r"^\s*(?:function|if|for|while|switch|try)\b", code, re.MULTILINE))
        assert opened == len(re.findall(r"^\s*end\b", code, re.MULTILINE)), name
        assert all(len(word) <= 63 for word in re.findall(r"\w+", code))


def test_text_of_the_model_stays() -> None:
    model = hsdsl.load(ROOT / "models/thermostat.yaml")
    files = files_of(source_of(model, {}), "matlab")
    found = "".join(files[f"thermostat_{part}.m"].decode() for part in ("model", "parameters", "initial", "D"))
    found = "".join(
        line
        for line in found.splitlines(keepends=True)
        if not line.startswith(("% Generated", "% model", "  m.gateway"))
    )
    assert_golden(found, Path(__file__).parent / "golden" / "thermostat.matlab.txt")


def test_what_it_lacks_is_refused(tmp_path: Path) -> None:
    model = hsdsl.load(ROOT / "models/oscillator-with-stop-1.yaml")
    with pytest.raises(UsageError, match="no scheme paoli-schatzman"):
        files_of(source_of(model, {"scheme": "paoli-schatzman", "step": "1e-3"}), "matlab")
    long = tmp_path / f"{'a' * 120}.yaml"
    long.write_text((ROOT / "models/thermostat.yaml").read_text())
    assert max(map(len, files_of(source_of(hsdsl.load(long), {}), "matlab"))) < 63
