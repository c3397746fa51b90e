"""Timelines of pages, in C, against those of runs: every segment, every digit, for random parameters."""

from __future__ import annotations

import random
import subprocess
from pathlib import Path

import pytest
from export.c_builds import COMPILERS

import hsdsl
from hsdsl.engine.runtime.library import RUNTIME
from hsdsl.engine.simulate import Problem
from hsdsl.export import source_of
from hsdsl.export.c import c_sources
from hsdsl.export.web import PARTS
from hsdsl.export.web.model import page_numbers

MAIN = r"""
#include <stdio.h>
#include "page.h"
#include "page_numbers.h"
#include "timeline.c"
int main(void) {
  double p[PROBLEM_PARAMETERS + 1], until;
  hs_timeline made;
  while (scanf("%lf", &until) == 1) {
    for (int i = 0; i < PROBLEM_PARAMETERS; i++)
      if (scanf("%lf", &p[i]) != 1) return 1;
    printf("%d", make_timeline(p, until, &made));
    for (int64_t k = 0; k < made.segments; k++) {
      printf(" %a %a %d", made.start[k], made.end[k], made.jump[k]);
      for (int i = 0; i < PROBLEM_DATA; i++) printf(" %a", made.data[k * PROBLEM_DATA + i]);
    }
    printf("\n");
  }
}
"""
HEAD = "hsdsl: 1\nparameters: {a: 1, b: 2, c: -1, d: a*b}\n"
TAIL = "initial: {mode: on, x: 0}\nexperiment: {until: 5 + a}\n"
SAMPLED = "u: {times: [0, 1, 2.5, 4], values: [1, -1, b, b], hold: HOLD}"
MODES = 'modes: {on: {flow: {x: "FLOW"}}}'
LINE = "w: {times: [-2, b**2, b**2 + 3], values: [a, c, d], hold: linear}"
# inputs, and a flow
CASES = {
    "inputs": (f"{SAMPLED.replace('HOLD', 'zero')}, {LINE}", "u + w"),
    "switches": ("", "floor(a*t + c) + sign(b - t) + max(t - d, c*t) + abs(t - a - c)"),
    "nested": ("", "sign(a/2 - (b*t - floor(b*t))) + floor(t/3 - floor(t/3) + c)"),
    "at the end": (
        "u: {times: [0, 5 + a], values: [1, b], hold: zero}, "
        "v: {times: [1, 5 + a, 7 + a], values: [a, b, c], hold: linear}",
        "u + v + floor(t/(5 + a)) + sign(t - 5 - a) + abs(t - a - 5) + floor(a*t)",
    ),
    "ramps that jump": (
        "u: {times: [0, 1, 1, 2.5, 2.5, 4], values: [1, -1, b, b, c, a], hold: linear}, "
        "v: {times: [-1, -1, a, a, 5 + a, 5 + a, 9 + a], values: [0, a, b, c, c, d, b], hold: linear}, "
        "w: {times: [0, 2, 2, 5 + a, 5 + a], values: [1, 2, 2, 1, 0], hold: linear}",
        "u + v + w",
    ),
    "of inputs": (f"{SAMPLED.replace('HOLD', 'linear')}", "abs(u) + sign(u - c*t) + min(u, floor(a*t))"),
}


# a mode beside `on`, so that it slides along a ramp: there its kinks are jumps
SLIDES = """modes:
  on: {flow: {x: -1}, transitions: [{when: x <= u, to: off}]}
  off: {flow: {x: 1}, transitions: [{when: x >= u, to: on}]}
"""
CASES["a ramp to slide along"] = (f"{SAMPLED.replace('HOLD', 'linear')}", SLIDES)


def timeline_numbers(problem: Problem) -> list[float]:
    return [
        number
        for segment in problem.timeline.segments
        for number in (segment.start, segment.end, segment.jump, *segment.data)
    ]


@pytest.mark.parametrize("name", CASES)
def test_segments_are_those_of_a_run(name: str, tmp_path: Path) -> None:
    inputs, flow = CASES[name]
    modes = flow if flow is SLIDES else MODES.replace("FLOW", flow)
    end = TAIL.replace("a}", "a, completion: auto}") if flow is SLIDES else TAIL
    model = hsdsl.loads(f"{HEAD}inputs: {{{inputs}}}\n{modes}\n{end}")
    source = source_of(model, {})
    texts = {"main.c": MAIN.encode(), "page_numbers.h": page_numbers(source.problem).encode()}
    texts |= {part: (PARTS / part).read_bytes() for part in ("page.h", "timeline.c")}
    for part, content in (c_sources(source) | texts).items():
        (tmp_path / part).parent.mkdir(exist_ok=True)
        (tmp_path / part).write_bytes(content)
    command = next(iter(COMPILERS.values()))
    files = [str(tmp_path / part) for part in ("main.c", "problem.c", "model.c")]
    flags = ["-std=c99", "-ffp-contract=off", f"-I{tmp_path}", f"-I{RUNTIME}", "-o", str(tmp_path / "timeline")]
    subprocess.run([*command, *flags, *files, "-lm"], check=True, capture_output=True)
    draw, runs, lines = random.Random(name), [], []
    for k in range(60):
        size = 2.0 ** draw.randint(-3, 3) if k % 2 else 1
        given = {each: draw.choice([round(draw.uniform(-2, 3), 1), draw.uniform(-2, 3) * size]) for each in "abc"}
        given["a"] = abs(given["a"])
        runs.append(source_of(model, {"parameters": given}).problem)
        values = runs[-1].timeline.segments[0].data[:4]
        lines.append(" ".join(repr(float(number)) for number in (runs[-1].settings.until, *values)))
    done = subprocess.run([tmp_path / "timeline"], input="\n".join(lines), capture_output=True, text=True, check=True)
    for run, line in zip(runs, done.stdout.splitlines(), strict=True):
        status, *found = line.split()
        assert status == "0"
        assert [float.fromhex(text) for text in found] == timeline_numbers(run)
