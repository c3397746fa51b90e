"""Rules on automata of systems: what holds in every scope is found, and nothing that others may change."""

from __future__ import annotations

import pytest

from hsdsl.analysis.lint import lint

MODEL = """
hsdsl: 1
parameters: {g: 9.81}
automata:
  ball:
    parameters: {c: 1/2}
    modes:
      fly:
        flow: {h: v, v: -g}
        transitions:
          - {name: bounce, when: h <= 0, reset: {v: -c*v}}
          - {name: same, when: h <= 0, to: rest}
          - {name: odd, when: v >= 3, to: rest}
      rest: {flow: {h: 0}, transitions: [{name: back, when: h >= 1, to: fly, reset: {v: 0}}]}
  room:
    inputs: [u]
    modes:
      on:
        flow: {T: 3 - T + u, n: 1}
        transitions:
          - {name: off, when: T >= 2, to: off}
          - {name: never, when: n <= -1, to: off}
          - {name: maybe, when: T <= 1, if: 2 > 3, to: off}
      off: {flow: {T: -T, n: 1}, transitions: [{name: cold, when: T >= 2.5, to: on}]}
system:
  b: {automaton: ball, initial: {mode: fly, h: 1, v: 0}}
  r: {automaton: room, initial: {mode: on, T: 0, n: 0}, inputs: {u: b.h}}
  s: {automaton: room, initial: {mode: on, T: 0, n: 0}, inputs: {u: 2*b.h}}
experiment: {until: 1}
"""


def found(tmp_path, text: str) -> list[tuple[str, str]]:
    (tmp_path / "m.yaml").write_text(text)
    return [(one.code, one.message.split("'")[1] if "'" in one.message else "") for one in
            lint(tmp_path / "m.yaml").findings if one.severity != "note"]  # fmt: skip


def test_what_holds_of_each_automaton(tmp_path):
    """Shadowed and overlapping guards of the ball, which is alone; what no flow of a room crosses."""
    assert sorted(found(tmp_path, MODEL)) == [
        ("HS427", "b.bounce"),
        ("HS428", ""),
        ("HS501", "b.back"),
        ("HS501", "r.cold"),
        ("HS501", "r.maybe"),
        ("HS501", "r.never"),
        ("HS508", "b.bounce"),
    ]


BOUNCE, OFF = "bounce, when: h <= 0, reset: {v: -c*v", "off: {flow: {T: -T, n: 1}"
OTHERS = {  # what makes a guard one that may fire
    "others set its state": (BOUNCE, BOUNCE + ", r.n: -2"),
    "the flow depends on others": (OFF, "off: {flow: {T: u - T, n: 1 - u}"),
    "it joins others": (OFF + ", transitions: [", OFF + ", transitions: [{on: b.bounce, reset: {T: 5}}, "),
    "its level depends on others": ("when: T >= 2.5, to", "when: T >= b.h, to"),
}


@pytest.mark.parametrize("what", OTHERS)
def test_what_others_may_change_is_no_finding(tmp_path, what):
    old, new = OTHERS[what]
    assert old in MODEL
    kept = "never" if "set its" in what else "cold"
    assert ("HS501", f"r.{kept}") in found(tmp_path, MODEL)
    assert ("HS501", f"r.{kept}") not in found(tmp_path, MODEL.replace(old, new))


def test_events_of_parts_are_looked_past(tmp_path):
    text = MODEL.replace("name: odd, when: v >= 3", "name: odd, event: v >= 3").replace(
        "name: same, when", "name: same, event"
    )
    codes = found(tmp_path, text)
    assert ("HS501", "b.odd") not in codes and ("HS427", "b.bounce") not in codes


UNITS = """
hsdsl: 1
parameters: {g: 9.81, m: {value: 2, unit: kg}, near: {value: 1, unit: m}}
let: {top: "max(near, sum(car.v))"}
automata:
  car:
    parameters: {m: 3, up: {value: 9, unit: kg}}
    inputs: [force]
    units: {x: m, v: m/s, force: N, f: 1/h}
    outputs: {f: m*v}
    modes:
      low:
        let: {ahead: x + v}
        flow: {x: v, v: force/m}
        transitions: [{name: shift, when: v >= up, to: high}]
      high:
        flow: {x: force, v: 0}
        transitions: [{name: low, on: car.shift, to: low, reset: {v: x}}]
system:
  car:
    automaton: car
    count: 2
    initial: {mode: low, x: m, v: 1}
    inputs: {force: "car[index - 1].x + near"}
    at_ends: {x: 0}
  one: {automaton: car, initial: {mode: low, x: near, v: 1}, inputs: {force: 1}, parameters: {up: 3}}
outputs: {gap: "car[1].x - car[2].v"}
experiment: {until: 1}
"""


def test_units_of_automata_and_connections(tmp_path):
    path = tmp_path / "units.yaml"
    path.write_text(UNITS)
    found = [(f.code, f.span.line, f.message) for f in lint(path).findings if f.code.startswith("HS6")]
    assert found == [
        ("HS602", 4, "`sum(car.v)`, in m/s, is compared with something in m"),
        ("HS602", 13, "`v`, in m/s, is added to something in m"),
        ("HS602", 15, "`up`, in kg, is compared with something in m/s"),
        ("HS604", 17, "the flow of 'x' is in N, and should be in m/s"),
        ("HS605", 18, "the new value of 'v' is in m, and should be in m/s"),
        ("HS605", 23, "the initial value of 'car.x' is in kg, and should be in m"),
        ("HS605", 24, "the input 'car.force' is in m, and should be in N"),
        ("HS602", 27, "`car[2].v`, in m/s, is added to something in m"),
    ]
