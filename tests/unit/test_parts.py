"""Systems of parts: the execution of the flat model that is their product, names, broadcasts, and what is refused."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from engines import ENGINES, needs_compiler

import hsdsl
from hsdsl.engine.simulate.verdict.run_view import RunView
from hsdsl.language.elaborate.derived import flat_part

MODELS = Path(__file__).parents[2] / "models" / "parts"
WAYS = [
    {},
    {"method": "dopri5", "tolerance": 1e-8},
    {"method": "radau", "tolerance": 1e-7},
    {"scheme": "relaxed", "relaxation": 1e-4},
    {"scheme": "relaxed", "method": "rk4", "step": 1e-3, "relaxation": 1e-3},
]

ROOMS = """
hsdsl: 1
parameters: {outside: 5, wall: 1/4}
automata:
  room:
    parameters: {power: 30, loss: 1/2, low: 19, high: 21}
    inputs: [beside]
    let: {gain: wall*(beside - T)}
    modes:
      on: {flow: {T: power - loss*(T - outside) + gain}, transitions: [{name: too_warm, when: T >= high, to: off}]}
      off: {flow: {T: -loss*(T - outside) + gain}, transitions: [{name: too_cold, when: T <= low, to: on}]}
system:
  a: {automaton: room, initial: {mode: on, T: 20}, inputs: {beside: b.T}}
  b: {automaton: room, initial: {mode: off, T: 20.5}, inputs: {beside: a.T}, parameters: {power: 20}}
experiment: {until: 1}
"""
HEAT = {
    "on": "{i}power - {i}loss*({i}T - outside) + wall*({j}T - {i}T)",
    "off": "-{i}loss*({i}T - outside) + wall*({j}T - {i}T)",
}
NUMBERS = "aloss: 1/2, alow: 19, ahigh: 21, bpower: 20, bloss: 1/2, blow: 19, bhigh: 21"


def flat_rooms() -> str:
    """The same, with the four modes of the product."""
    text = f"hsdsl: 1\nparameters: {{outside: 5, wall: 1/4, apower: 30, {NUMBERS}}}\nmodes:\n"
    for one, two in itertools.product(("on", "off"), repeat=2):
        flow = HEAT[one].format(i="a", j="b"), HEAT[two].format(i="b", j="a")
        text += f"  {one}_{two}:\n    flow: {{aT: {flow[0]}, bT: {flow[1]}}}\n    transitions:\n"
        for name, here, others in (("a", one, "{0}_" + two), ("b", two, one + "_{0}")):
            if here == "on":
                text += f"      - {{name: {name}.too_warm, when: {name}T >= {name}high, to: {others.format('off')}}}\n"
            else:
                text += f"      - {{name: {name}.too_cold, when: {name}T <= {name}low, to: {others.format('on')}}}\n"
    return text + "initial: {mode: on_off, aT: 20, bT: 20.5}\nexperiment: {until: 1}\n"


@pytest.mark.parametrize("way", WAYS, ids=lambda way: "-".join(map(str, way.values())) or "default")
@pytest.mark.parametrize("engine", ENGINES)
def test_parts_have_the_execution_of_their_product(way, engine):
    run = hsdsl.loads(ROOMS).simulate(engine=engine, **way)
    flat = hsdsl.loads(flat_rooms()).simulate(engine=engine, **way)
    assert [t.edge for t in run.transitions] == [t.edge for t in flat.transitions]
    for one, other in zip(run.transitions, flat.transitions, strict=True):
        assert (one.time, one.resumed) == pytest.approx((other.time, other.resumed), rel=0, abs=1e-13)
        assert list(one.before.values()) == pytest.approx(list(other.before.values()), rel=1e-13)
    assert list(run.final.state.values()) == pytest.approx(list(flat.final.state.values()), rel=1e-12)
    assert len(run.transitions) > 8
    assert [arc.mode for arc in run.arcs] == ["a={} b={}".format(*arc.mode.split("_")) for arc in flat.arcs]
    assert run.verdict == flat.verdict


@needs_compiler
@pytest.mark.parametrize("name", ["runner", "centipede"])
@pytest.mark.parametrize("way", [{}, {"scheme": "relaxed", "relaxation": 1e-3}], ids=["located", "relaxed"])
def test_engines_agree_to_the_last_bit(name, way):
    model = hsdsl.load(MODELS / f"{name}.yaml")
    one, other = (model.simulate(until=0.4, engine=engine, tolerance=1e-6, **way) for engine in ("python", "c"))
    assert one == replace(other, engine="python", verdict=one.verdict)


LEG = """
  leg:
    parameters: {speed: 1}
    modes:
      swing:
        flow: {s: speed}
        let: {push: 0}
        transitions: [{name: down, when: s >= 0.3, to: stance, reset: {foot: body.x + s}}]
      stance:
        flow: {foot: 0}
        let: {push: 3*(1 - (foot - body.x))}
        transitions: [{name: up, when: foot - body.x <= -0.3, to: lift, reset: {u: foot - body.x}}]
      lift:
        flow: {u: 2*speed}
        let: {push: -0.1*u}
        transitions: [{name: forward, when: u >= 0.1, to: swing, reset: {s: u/2}}]
"""
WALKER = f"""
hsdsl: 1
automata:
  body:
    modes: {{move: {{flow: {{x: v, v: sum(leg.push) - 4*v}}}}}}
{LEG}
system:
  body: {{automaton: body, initial: {{x: 0, v: 1}}}}
  leg: {{automaton: leg, count: 4, initial: {{mode: swing, s: index/20}}, parameters: {{speed: 1 + index/10}}}}
experiment: {{until: 2}}
"""
KINDS = {
    "swing": ("s", "{speed}", "0", "down", "s{i} >= 0.3", "stance", "foot{i}: x + s{i}"),
    "stance": ("foot", "0", "3*(1 - (foot{i} - x))", "up", "foot{i} - x <= -0.3", "lift", "u{i}: foot{i} - x"),
    "lift": ("u", "2*{speed}", "-0.1*u{i}", "forward", "u{i} >= 0.1", "swing", "s{i}: u{i}/2"),
}


def flat_walker() -> str:
    """The walker with its 81 modes."""
    text = "hsdsl: 1\nmodes:\n"
    for modes in itertools.product(KINDS, repeat=4):
        speeds = [f"(1 + {i}/10)" for i in range(1, 5)]
        numbered = [(i, KINDS[mode], speed) for i, mode, speed in zip(range(1, 5), modes, speeds, strict=True)]
        pushes = " + ".join(kind[2].format(i=i) for i, kind, _ in numbered)
        own = ", ".join(f"{kind[0]}{i}: {kind[1].format(speed=speed)}" for i, kind, speed in numbered)
        text += f"  {'_'.join(modes)}:\n    flow: {{x: v, v: {pushes} - 4*v, {own}}}\n    transitions:\n"
        for i, kind, _ in numbered:
            target = "_".join((*modes[: i - 1], kind[5], *modes[i:]))
            text += f'      - {{name: "leg[{i}].{kind[3]}", when: {kind[4].format(i=i)}, to: {target}, '
            text += f"reset: {{{kind[6].format(i=i)}}}}}\n"
    start = ", ".join(f"s{i}: {i}/20" for i in range(1, 5))
    return text + f"initial: {{mode: swing_swing_swing_swing, x: 0, v: 1, {start}}}\nexperiment: {{until: 2}}\n"


def test_four_legs_walk_as_their_81_modes():
    run, flat = hsdsl.loads(WALKER).simulate(), hsdsl.loads(flat_walker()).simulate()
    assert [t.edge for t in run.transitions] == [t.edge for t in flat.transitions]
    assert len({arc.mode for arc in run.arcs}) > 9
    assert np.allclose([t.time for t in run.transitions], [t.time for t in flat.transitions], rtol=0, atol=1e-12)
    assert run.final.state["body.x"] == pytest.approx(flat.final.state["x"], abs=1e-12)
    assert len(run.transitions) > 20


@pytest.mark.parametrize("number", [0, 1])
def test_the_runner_of_parts_runs_as_the_flat_one(number):
    model = hsdsl.load(MODELS / "runner.yaml")
    known = model.system.reference[number]
    run = model.simulate(
        initial={key.removeprefix("initial."): value for key, value in known.settings.items()}, tolerance=1e-13
    )
    assert [t.edge for t in run.transitions] == [t.edge for t in known.transitions]
    for made, exact in zip(run.transitions, known.transitions, strict=True):
        assert made.time == pytest.approx(float(exact.time), abs=1e-11)
        for name, value in exact.before.items():
            assert made.before[name] == pytest.approx(float(value), abs=2e-11)
    assert run.final.mode == "body=apex left=spent right=spent"


def test_neighbours_and_ends():
    """A chain of masses in its lowest normal mode: cos of a known frequency."""
    text = """
    hsdsl: 1
    automata:
      mass:
        inputs: [left, right]
        modes: {move: {flow: {x: v, v: left - 2*x + right}}}
    system:
      chain:
        automaton: mass
        count: 5
        initial: {x: sin(pi*index/6), v: 0}
        inputs: {left: "chain[index - 1].x", right: "chain[index + 1].x"}
        at_ends: {x: 0*index}
    outputs: {energy: sum(chain.v**2)/2, most: max(chain.x), least: min(chain.x), n: count(chain)}
    experiment: {until: 3}
    """
    run = hsdsl.loads(text).simulate()
    phase = np.cos(2 * np.sin(np.pi / 12) * 3)
    for k in range(1, 6):
        assert run.final.state[f"chain[{k}].x"] == pytest.approx(np.sin(np.pi * k / 6) * phase, abs=1e-9)
    assert run.final.outputs["least"] == min(run.final.state[f"chain[{k}].x"] for k in range(1, 6))
    assert run.final.outputs["n"] == 5


def test_states_that_a_mode_lacks_are_absent():
    run = hsdsl.loads(WALKER).simulate(until=0.5)
    first, last = run.arcs[0], run.arcs[-1]
    assert first.states == ("body.x", "body.v", *(f"leg[{k}].s" for k in range(1, 5)))
    assert "leg[4].foot" in last.states
    assert "leg[4].s" not in run.final.state
    assert np.isnan(run.to_pandas()["leg[4].s"].iloc[-1])


def test_overrides_reach_parts():
    model = hsdsl.loads(ROOMS)
    run = model.simulate(parameters={"b.power": 25}, initial={"b.mode": "on", "a.T": "outside + 15"})
    assert run.arcs[0].mode == "a=on b=on"
    assert model.simulate(initial={"mode": "a=off b=off"}).arcs[0].mode == "a=off b=off"
    for initial in ({"b.mode": "warm"}, {"b": 1}, {"mode": "a=on"}, {"c.T": 1}):
        with pytest.raises(hsdsl.UsageError):
            model.simulate(initial=initial)


def test_automata_in_files(tmp_path):
    head, _, rest = WALKER.partition("  leg:\n")
    leg = rest.partition("\nsystem:")[0]
    (tmp_path / "leg.yaml").write_text("hsdsl: 1\n" + "\n".join(line[4:] for line in leg.splitlines()))
    whole = head + "  leg: {file: leg.yaml}\nsystem:" + rest.partition("\nsystem:")[2]
    (tmp_path / "walker.yaml").write_text(whole)
    assert hsdsl.load(tmp_path / "walker.yaml").simulate(until=1).final == hsdsl.loads(WALKER).simulate(until=1).final
    (tmp_path / "leg.yaml").write_text((tmp_path / "leg.yaml").read_text().replace("s >= 0.3", "q >= 0.3"))
    with pytest.raises(hsdsl.ModelError) as error:
        hsdsl.load(tmp_path / "walker.yaml")
    assert error.value.diagnostics[0].span.path.endswith("leg.yaml")


HEAD = "hsdsl: 1\nexperiment: {until: 1}\n"
CLOCK = "automata: {a: {modes: {m: {flow: {x: 1}}}}}\n"
ONE = "system: {p: {automaton: a, initial: {x: 0}}}\n"
REFUSED = {
    "HS350 automaton": CLOCK + "system: {p: {automaton: b, initial: {x: 0}}}",
    "HS351 connected": "automata: {a: {inputs: [u], modes: {m: {flow: {x: u}}}}}\n" + ONE,
    "HS352 q.y -> q.u -> p.y": (
        "automata: {a: {inputs: [u], let: {y: 2*u}, modes: {m: {flow: {x: y}}}}}\n"
        "system:\n"
        "  p: {automaton: a, initial: {x: 0}, inputs: {u: q.y}}\n"
        "  q: {automaton: a, initial: {x: 0}, inputs: {u: p.y}}"
    ),
    "HS354 force": (
        "automata: {a: {modes: {m: {flow: {x: 1}, let: {force: 1}, transitions: [{when: x >= 1, to: n}]}, "
        "n: {flow: {x: 0}}}}}\n"
        "system: {p: {automaton: a, initial: {mode: m, x: 0}}}\n"
        "let: {total: sum(a.force)}"
    ),
    "HS313 'v' is neither": "automata: {a: {modes: {m: {flow: {x: 1}}}, units: {v: m}}}\n" + ONE,
    "HS316 has the unit": "automata: {a: {parameters: {k: {value: 1, unit: m}}, modes: {m: {flow: {x: 1}}}, "
    "units: {k: s}}}\n" + ONE,
    "HS111 speed": "automata: {a: {modes: {m: {flow: {x: speed}}}}}\n" + ONE,
    "HS111 q.x": "automata: {a: {modes: {m: {flow: {x: q.x}}}}}\n" + ONE,
    "HS353 fire together": (
        "automata:\n"
        "  a: {modes: {m: {flow: {x: 1}, transitions: [{name: go, when: x >= 1, reset: {x: 0, q.x: 1}}]}}}\n"
        "  b: {modes: {m: {flow: {x: 1}, transitions: [{on: p.go, reset: {x: 2}}]}}}\n"
        "system: {p: {automaton: a, initial: {x: 0}}, q: {automaton: b, initial: {x: 0}}}"
    ),
    "HS353 nothing": (
        "automata: {a: {modes: {m: {flow: {x: 1}, transitions: [{on: q.nothing, reset: {x: 2}}]}}}}\n"
        "system: {p: {automaton: a, initial: {x: 0}}, q: {automaton: a, initial: {x: 0}}}"
    ),
    "HS353 twice": (
        "automata: {a: {modes: {m: {flow: {x: 1}, transitions: [{when: x >= 1, reset: {x: 0, p.x: 1}}]}}}}\n" + ONE
    ),
    "HS353 itself": (
        "automata: {a: {modes: {m: {flow: {x: 1}, transitions: [{on: p.go, reset: {x: 1}}, "
        "{name: go, when: x >= 1, reset: {x: 0}}]}}}}\n" + ONE
    ),
    "HS323 persistent": (
        "automata: {a: {modes: {m: {flow: {x: 1}, transitions: [{when: x >= 1, persistent: false, "
        "reset: {x: 0}}]}}}}\n" + ONE
    ),
    "HS301 also a parameter": "automata: {a: {parameters: {x: 2}, modes: {m: {flow: {x: 1}}}}}\n" + ONE,
    "HS301 also an input": (
        "automata: {a: {inputs: [u, u], modes: {m: {flow: {x: u}}}}}\n"
        "system: {p: {automaton: a, initial: {x: 0}, inputs: {u: 1}}}"
    ),
    "HS301 is a `let` name": "automata: {a: {let: {x: 2}, modes: {m: {flow: {x: 1}}}}}\n" + ONE,
    "HS301 a state of this mode": "automata: {a: {modes: {m: {flow: {x: 1}, let: {x: 2}}}}}\n" + ONE,
    "HS202 no modes": "automata: {a: {modes: {}}}\nsystem: {p: {automaton: a}}",
    "HS353 either `modes`": "modes: {m: {flow: {y: 1}}}\n" + CLOCK + ONE,
    "HS111 no automaton or instance": "automata: {a: {modes: {m: {flow: {x: sum(b.x)}}}}}\n" + ONE,
    "HS314 p.stop": (
        "automata: {a: {modes: {m: {flow: {x: 1}, transitions: [{name: go, when: x >= 1, reset: {x: 0}}]}}}}\n"
        + ONE
        + "reference: {transitions: [{time: 1, edge: p.stop}]}"
    ),
    "HS204 at most 9 digits": CLOCK + "system: {p: {automaton: a, count: 10000000000, initial: {x: 0}}}",
    "HS308 initial value": CLOCK + "system: {p: {automaton: a}}",
    "HS303 no mode": CLOCK + "system: {p: {automaton: a, initial: {mode: k}}}",
    "HS353 `modes` besides": CLOCK + ONE + "modes: {m: {flow: {y: 1}}}",
    "HS350 no automaton 'b'": (
        CLOCK + "system:\n  p: {automaton: b, count: 2, initial: {x: 0}}\n"
        "  r: {automaton: a, initial: {x: 'p[1].x'}}\n"
        "outputs: {total: sum(p.x), how_many: count(a.m), whole: count(p), one: 'p[1].x'}"
    ),
    "HS321 `count`": (
        CLOCK + "system: {p: {automaton: a, count: 0, initial: {x: 0}}}\n"
        "outputs: {total: sum(p.x), how_many: count(a.m)}"
    ),
    "HS111 no automaton or instance 'b'": CLOCK + ONE + "outputs: {total: sum(b.x**2)}",
    "HS111 no instance uses": (
        "automata: {a: {modes: {m: {flow: {x: 1}}}}, b: {modes: {m: {flow: {x: 1}}}}}\n"
        + ONE
        + "outputs: {total: sum(b.x)}"
    ),
    "HS113 ranges over the instances of one automaton, each": (
        CLOCK + "system: {p: {automaton: a, count: 2, initial: {x: 0}}}\noutputs: {total: sum(p)}"
    ),
    "HS111 has 2 instances": CLOCK + 'system: {p: {automaton: a, count: 2, initial: {x: 0}}}\nlet: {y: "p[3].x"}',
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_refused(what):
    code, _, words = what.partition(" ")
    with pytest.raises(hsdsl.ModelError) as error:
        hsdsl.loads(HEAD + REFUSED[what])
    found = [d for d in error.value.diagnostics if d.code == code and words in d.message]
    assert found and found[0].span is not None
    assert len(error.value.diagnostics) == 1


UNITS = """automata:
  a:
    parameters: {k: {value: 2, unit: 1/s}, m: 1}
    inputs: [u]
    outputs: {p: k*x}
    modes: {m: {flow: {x: u, y: since}}}
    units: {x: m, m: kg, u: m/s, p: m/s}
system:
  one: {automaton: a, initial: {x: 0, y: 0}, inputs: {u: 1}}
  other: {automaton: a, count: 2, initial: {x: 0, y: 0}, inputs: {u: 1}}
units: {one.x: km, t: s}
"""


def test_instances_have_the_units_of_their_automaton():
    model = hsdsl.loads(HEAD + UNITS)
    assert model.program.units == {
        f"{part}.{name}": unit
        for part in ("one", "other[1]", "other[2]")
        for name, unit in {"x": "m", "m": "kg", "u": "m/s", "p": "m/s", "k": "1/s", "since": "s"}.items()
    } | {"one.x": "km", "t": "s"}
    assert [(p.name, p.unit) for p in model.system.parameters][:2] == [("one.k", "1/s"), ("one.m", "kg")]


def test_connections_name_states_by_their_part():
    text = "automata: {a: {inputs: [u], modes: {m: {flow: {x: u}}}}}\n"
    text += "system: {p: {automaton: a, initial: {x: 0}, inputs: {u: -x}}}"
    with pytest.raises(hsdsl.ModelError) as error:
        hsdsl.loads(HEAD + text)
    assert error.value.diagnostics[0].hint == "write p.x: names of parts have the part in front"


def test_an_automaton_of_one_instance_may_listen_to_its_other_instances():
    text = (
        "automata: {a: {modes: {m: {flow: {x: 1}, transitions: [{on: a.go, reset: {x: -1}}, "
        "{name: go, when: x >= 1/2, reset: {x: 0}}]}}}}\nsystem: {p: {automaton: a, initial: {x: 0}}}"
    )
    assert [m.edge for m in hsdsl.loads(HEAD + text).simulate(engine="python").transitions] == ["p.go", "p.go"]


def test_a_broadcast_with_conditions_and_listeners_of_listeners():
    text = """
    hsdsl: 1
    automata:
      clock: {modes: {run: {flow: {s: 1}, transitions: [{name: tick, when: s >= 1, reset: {s: 0}}]}}}
      counter:
        modes:
          even: {flow: {n: 0}, transitions: [{name: up, on: clock.tick, if: n < 3, to: odd, reset: {n: n + 1}}]}
          odd: {flow: {n: 0}, transitions: [{name: up, on: clock.tick, if: n < 3, to: even, reset: {n: n + 1}}]}
      diary: {modes: {keep: {flow: {seen: 0}, transitions: [{on: counter.up, reset: {seen: 10*seen + counter.n}}]}}}
    system:
      clock: {automaton: clock, initial: {s: 0}}
      counter: {automaton: counter, initial: {mode: even, n: 0}}
      diary: {automaton: diary, initial: {seen: 0}}
    experiment: {until: 5.5}
    """
    model = hsdsl.loads(text)
    for engine in ENGINES:
        run = model.simulate(engine=engine)
        assert run.final.state == {"clock.s": pytest.approx(0.5), "counter.n": 3.0, "diary.seen": 12.0}
        assert [t.time for t in run.transitions] == pytest.approx([1, 2, 3, 4, 5])
        assert run.transitions[2].target == "clock=run counter=odd diary=keep"


def test_balls_come_to_rest_while_others_go_on():
    text = """
    hsdsl: 1
    automata:
      ball:
        modes: {fly: {flow: {h: v, v: -9.81}, transitions: [{name: bounce, when: h <= 0, reset: {v: -v/2}}]}}
      lamp:
        modes:
          dark: {flow: {s: 1}, transitions: [{when: s >= 0.7, to: bright, reset: {s: 0}}]}
          bright: {flow: {s: 1}, transitions: [{when: s >= 0.3, to: dark, reset: {s: 0}}]}
    system:
      ball: {automaton: ball, count: 2, initial: {h: index, v: 0}}
      lamp: {automaton: lamp, initial: {mode: dark, s: 0}}
    experiment: {until: 3.5}
    """
    run = hsdsl.loads(text).simulate()
    assert abs(run.final.state["ball[1].h"]) + abs(run.final.state["ball[2].h"]) < 1e-15
    rests = [3 * np.sqrt(2 * h / 9.81) for h in (1, 2)]
    assert all(any(f"Zeno at t = {rest:.5f}"[:17] in reason for reason in run.verdict.reasons) for rest in rests)
    assert sum(t.edge.startswith("lamp") for t in run.transitions) == 6


def test_since_is_of_the_part():
    text = """
    hsdsl: 1
    functions: {twice: {of: [u], is: 2*u}}
    automata:
      blinker:
        parameters: {pause: 1}
        modes:
          dark: {flow: {}, transitions: [{when: since >= pause, to: bright}]}
          bright: {flow: {}, let: {light: twice(since)}, transitions: [{when: since >= 2*pause, to: dark}]}
    system:
      a: {automaton: blinker, initial: {mode: dark}}
      b: {automaton: blinker, initial: {mode: dark}, parameters: {pause: 0.7}}
    outputs: {light: a.light}
    experiment: {until: 6.5}
    """
    run = hsdsl.loads(text).simulate()
    times = {"a": [1, 3, 4, 6], "b": [0.7, 2.1, 2.8, 4.2, 4.9, 6.3]}
    for name, expected in times.items():
        made = [t.time for t in run.transitions if t.edge.startswith(name)]
        assert made == pytest.approx(expected, abs=1e-9)
    assert run(2.0)["light"] == pytest.approx(2.0)
    assert np.isnan(run(0.5)["light"])


def test_the_centipede_costs_what_its_legs_cost():
    model = hsdsl.load(MODELS / "centipede.yaml")
    assert len(model.program.modes) == 1
    assert len(model.program.modes[0].edges) == 40
    run = model.simulate(until=1)
    assert run.stop.reason == "until"
    assert len(run.transitions) > 30


def test_distances_are_those_of_the_flat_model():
    parts, flat = hsdsl.loads(ROOMS), hsdsl.loads(flat_rooms())
    one = hsdsl.distance(parts.simulate(until=0.3), parts.simulate(until=0.3, initial={"a.T": 20.01}), model=parts)
    other = hsdsl.distance(flat.simulate(until=0.3), flat.simulate(until=0.3, initial={"aT": 20.01}), model=flat)
    assert (one.lower, one.upper) == pytest.approx((other.lower, other.upper), rel=1e-6)
    assert one.lower > 0.009


def test_the_flat_part_of_visited_modes_has_the_same_execution():
    model = hsdsl.loads(WALKER)
    run = model.simulate(until=1.2)
    flat = hsdsl.Model(flat_part(model.system, [arc.mode for arc in run.arcs])).simulate(until=1.2)
    assert [t.edge for t in flat.transitions] == [t.edge for t in run.transitions]
    assert [t.time for t in flat.transitions] == pytest.approx([t.time for t in run.transitions], abs=1e-12)
    assert flat.final.mode == run.final.mode
    assert flat.final.state == pytest.approx(run.final.state, abs=1e-12)


@pytest.mark.parametrize("what", ["stability", "stream", "point", "complete", "export"])
def test_what_parts_do_not_have_yet_is_said(what, tmp_path):
    from hsdsl.export import files_of, source_of

    model = hsdsl.loads(ROOMS)
    calls = {
        "stability": lambda: model.orbital_stability(),
        "stream": lambda: model.stream(tmp_path / "rows.csv"),
        "point": lambda: model.distance("a=on b=on a.T=20 b.T=20", "a=on b=on a.T=20 b.T=20"),
        "complete": model.completed,
        "export": lambda: files_of(source_of(model, {}), "jax"),
    }
    with pytest.raises(hsdsl.UsageError, match=r"systems? of parts"):
        calls[what]()


def test_derivatives_are_those_of_the_flat_model_and_of_differences():
    model, by = hsdsl.loads(ROOMS), "a.power, wall, initial.b.T"
    run = model.simulate(until=0.8)
    flat = hsdsl.Model(flat_part(model.system, [arc.mode for arc in run.arcs]))
    found, expected = (each.sensitivity(by, until=0.8) for each in (model, flat))
    assert found.exists and found.final.mode == run.final.mode
    for one, other in zip((*found.transitions, found.final), (*expected.transitions, expected.final), strict=True):
        assert one.time == pytest.approx(other.time, rel=1e-9, abs=1e-12)
    for state, row in expected.final.state.items():
        assert found.final.state[state] == pytest.approx(row, rel=1e-9)

    model, step = hsdsl.loads(WALKER), 1e-5
    found = model.sensitivity("leg[1].speed", until=1, initial={"leg[3].mode": "lift", "leg[3].u": 0.05})
    ends = [
        model.simulate(until=1, initial={"leg[3].mode": "lift", "leg[3].u": 0.05}, parameters={"leg[1].speed": speed})
        for speed in (1.1 + step, 1.1 - step)
    ]
    assert found.final.mode == ends[0].final.mode and found.final.state.keys() == ends[0].final.state.keys()
    for state, row in found.final.state.items():
        difference = (ends[0].final.state[state] - ends[1].final.state[state]) / (2 * step)
        assert row["leg[1].speed"] == pytest.approx(difference, abs=1e-7)
    samples = found.sample([0.1, 0.5, 0.9])
    for name in ("leg[1].s", "leg[1].foot"):
        assert samples.values[name] == pytest.approx(found.run.sample([0.1, 0.5, 0.9])[name], abs=1e-9, nan_ok=True)
        assert np.array_equal(np.isnan(samples.values[name]), np.isnan(samples.slopes[name][:, 0]))


@pytest.mark.parametrize("name", ["a", "leg[3].mode", "initial.a", "initial.leg[3].foot"])
def test_numbers_of_modes_and_states_of_other_modes_have_no_derivatives(name):
    model = hsdsl.loads(ROOMS if name.endswith("a") else WALKER)
    with pytest.raises(hsdsl.UsageError, match="no parameter or initial state"):
        model.sensitivity(name)


SWITCHED = """
hsdsl: 1
automata:
  room:
    parameters: {low: 19, high: 21}
    modes:
      on: {flow: {T: 35 - T}, transitions: [{name: switch, when: T >= high, to: off}]}
      off: {flow: {T: 5 - T}, transitions: [{name: switch, when: T <= low, to: on}]}
  lag: {parameters: {rate: 1}, modes: {run: {flow: {y: rate*(a.T - y)}}}}
system:
  a: {automaton: room, initial: {mode: on, T: 20}}
  b: {automaton: lag, initial: {y: 20}}
experiment: {until: 3}
"""


def test_an_orbit_ends_in_the_modes_that_it_begins_with():
    model = hsdsl.loads(SWITCHED)
    orbit = model.orbit("a.switch", laps=2)
    period = np.log((35 - 19) / (35 - 21)) + np.log((21 - 5) / (19 - 5))
    assert orbit.period == pytest.approx(period, rel=1e-9)
    assert orbit.mode in ("a=on b=run", "a=off b=run")
    assert orbit.multipliers == pytest.approx([np.exp(-period)], rel=1e-7)
    with pytest.raises(hsdsl.UsageError, match="into other modes of parts") as error:
        model.orbit("a.switch")
    assert error.value.hint == "try more laps"


def test_a_fit_finds_a_parameter_of_a_part():
    model = hsdsl.loads(SWITCHED)
    times = np.linspace(0.1, 2.9, 15)
    table = model.simulate(parameters={"b.rate": 1.7}).sample(times)
    fit = model.fit({"time": times, "b.y": table["b.y"]}, "b.rate")
    assert fit.values["b.rate"] == pytest.approx(1.7, rel=1e-6)


def test_transitions_of_one_name_are_told_apart():
    prepared = hsdsl.loads(SWITCHED).pipeline.prepare({"until": 1})
    crossed = list(RunView(prepared, prepared.simulate()).crossed.values())
    assert len(crossed) > 4 and crossed == [k % 2 for k in range(len(crossed))]


STARTS = """
hsdsl: 1
parameters: {q: 3}
automata:
  mass:
    parameters: {k: 4}
    modes: {move: {flow: {x: v, v: -k*x}}, stop: {flow: {x: 0}}}
  body: {modes: {run: {flow: {y: 1, z: 0}}}}
system:
  body: {automaton: body, initial: {z: 2*y + q, y: sum(chain.x) + count(chain.move)}}
  chain:
    automaton: mass
    count: 3
    initial: {mode: move, x: "chain[index - 1].x + 1/k", v: x/2}
    at_ends: {x: q/3}
experiment: {until: 0}
"""


def test_initial_values_use_those_of_other_instances():
    model = hsdsl.loads(STARTS)
    assert model.simulate().final.state == {
        "body.y": 7.5, "body.z": 18.0, "chain[1].x": 1.25, "chain[1].v": 0.625,
        "chain[2].x": 1.5, "chain[2].v": 0.75, "chain[3].x": 1.75, "chain[3].v": 0.875,
    }  # fmt: skip
    changed = model.simulate(initial={"chain[2].x": 10}, parameters={"q": 4}).final.state
    assert (changed["chain[3].x"], changed["chain[2].v"]) == (10.25, 5.0)
    assert changed["body.y"] == 4 / 3 + 0.25 + 10 + 10.25 + 3
    found = model.sensitivity("q, initial.chain[2].x", initial={"chain[2].x": 10}, until=0)
    assert found.final.state["body.z"] == pytest.approx({"q": 2 / 3 + 1, "initial.chain[2].x": 4.0})


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("v: x/2", 'v: "chain[index].v"', "HS302"),
        ("z: 2*y", "z: body.z", "HS302"),
        ("z: 2*y", "z: t*y", "HS117"),
        ("z: 2*y + q", 'z: "chain[2].w"', "HS111"),
        ("z: 2*y", "z: yy", "HS111"),
        ("at_ends: {x: q/3}", "at_ends: {v: 1}", "HS111"),
        ('mode: move, x: "chain[index - 1].x + 1/k", v: x/2', "mode: stop, x: v", "HS308"),
    ],
)
def test_initial_values_that_have_none_are_reported(old, new, code):
    with pytest.raises(hsdsl.ModelError) as error:
        hsdsl.loads(STARTS.replace(old, new))
    assert {diagnostic.code for diagnostic in error.value.diagnostics} == {code}


SOLVED = """
hsdsl: 1
parameters: {l: 1/2, g: 9.81}
automata:
  cart:
    parameters: {M: 2, m: 1}
    inputs: [push]
    modes:
      still:
        flow: {x: 0, q: 0}
        let: {a: 0}
        transitions: [{name: go, when: t >= 0.25, to: swing, reset: {v: 0, w: 0, p: 1}}]
      swing:
        flow: {x: v, v: a, q: w, w: b, p: 0}
        let: {f: m*l*w**2*sin(q) + push, twice: 2*b}
        solve:
          unknowns: [a, b]
          equations: [p*(M + m)*a + p*m*l*cos(q)*b == p*f, m*l*cos(q)*a + m*l**2*twice/2 == -m*g*l*sin(q)]
        transitions: [{name: stop, when: x >= 1/100, to: still}]
  mass: {modes: {move: {flow: {y: u, u: 0.1*cart.a - y}}}}
system:
  cart: {automaton: cart, initial: {mode: still, x: 0, q: 2}, inputs: {push: mass.y}}
  mass: {automaton: mass, initial: {y: 1/10, u: 0}}
experiment: {until: 2}
"""
SOLVED_FLAT = """
hsdsl: 1
parameters: {l: 1/2, g: 9.81, M: 2, m: 1}
modes:
  still:
    flow: {x: 0, q: 0, y: u, u: -y}
    transitions: [{name: go, when: t >= 0.25, to: swing, reset: {v: 0, w: 0}}]
  swing:
    flow: {x: v, v: a, q: w, w: b, y: u, u: 0.1*a - y}
    solve:
      unknowns: [a, b]
      equations:
        - (M + m)*a + m*l*cos(q)*b == m*l*w**2*sin(q) + y
        - m*l*cos(q)*a + m*l**2*b == -m*g*l*sin(q)
    transitions: [{name: stop, when: x >= 1/100, to: still}]
initial: {mode: still, x: 0, q: 2, y: 1/10, u: 0}
experiment: {until: 2}
"""


@pytest.mark.parametrize("way", [{}, {"method": "radau", "tolerance": 1e-9}])
def test_equations_of_a_part_are_solved_in_their_mode(way):
    """In the other mode the matrix of the equations is singular."""
    found, expected = (hsdsl.loads(text).simulate(**way) for text in (SOLVED, SOLVED_FLAT))
    assert len(expected.transitions) > 1
    assert [made.edge for made in found.transitions] == [f"cart.{made.edge}" for made in expected.transitions]
    assert [t.time for t in found.transitions] == pytest.approx([t.time for t in expected.transitions], abs=1e-8)
    for name, value in expected.final.state.items():
        assert found.final.state[f"mass.{name}" if name in "yu" else f"cart.{name}"] == pytest.approx(value, abs=1e-8)


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("twice: 2*b", "twice: 2*b, b: 1", "HS301"),
        ("twice: 2*b", "twice: b**2", "HS325"),
        ("{push: mass.y}", "{push: cart.a}", "HS352"),
        ("let: {a: 0}", "let: {}", "HS354"),
        ("automata:\n", "solve: {unknowns: [c], equations: [c**2 == 1]}\nautomata:\n", "HS325"),
        ("automata:\n", "solve: {unknowns: [g], equations: [2*g == 1]}\nautomata:\n", "HS301"),
        ("automata:\n", "solve: {unknowns: [c], equations: [2*c == cart.nothing]}\nautomata:\n", "HS111"),
    ],
)
def test_equations_of_parts_that_have_no_solution_are_reported(old, new, code):
    assert old in SOLVED
    with pytest.raises(hsdsl.ModelError) as error:
        hsdsl.loads(SOLVED.replace(old, new, 1))
    assert code in {diagnostic.code for diagnostic in error.value.diagnostics}


MANIFOLD = """
hsdsl: 1
parameters: {R: 2}
functions: {cube: {of: [z], is: z**3}}
let: {volts: 5*cos(t), twice: 2*pressure}
solve:
  unknowns: [pressure, flux]
  equations: [flux == sum(tank.pull), R*flux + pressure == volts]
automata:
  tank:
    parameters: {c: 1}
    let: {pull: "c*(twice/2 - q)"}
    modes:
      open: {flow: {q: pull}, transitions: [{name: shut, when: q >= 1, to: closed}]}
      closed:
        flow: {q: cube(-q)/3 + flux/100}
        let: {pull: 0*q}
        transitions: [{name: reopen, when: q <= 1/2, to: open}]
system:
  tank: {automaton: tank, count: 2, initial: {mode: open, q: index/4}, parameters: {c: index}}
outputs: {p: pressure}
experiment: {until: 6}
"""


def flat_manifold() -> str:
    """The same, with four modes: p (1 + R sum(c)) = volts + R sum(c q) over the open tanks."""
    text = "hsdsl: 1\nmodes:\n"
    for modes in itertools.product(("open", "closed"), repeat=2):
        pull = [f"{k}*(p - q{k})" if mode == "open" else "0" for k, mode in enumerate(modes, 1)]
        own = [k for k, mode in enumerate(modes, 1) if mode == "open"]
        held = " + ".join(f"{k}*q{k}" for k in own) or "0"
        text += f"  {'_'.join(modes)}:\n    let: {{p: (5*cos(t) + 2*({held}))/(1 + 2*{sum(own)})}}\n    flow:\n"
        for k, mode in enumerate(modes, 1):
            flow = pull[k - 1] if mode == "open" else f"-q{k}**3/3 + ({' + '.join(pull)})/100"
            text += f"      q{k}: {flow}\n"
        text += "    outputs: {p: p}\n    transitions:\n"
        for k, mode in enumerate(modes, 1):
            target = "_".join((*modes[: k - 1], "closed" if mode == "open" else "open", *modes[k:]))
            name, when = ("shut", f"q{k} >= 1") if mode == "open" else ("reopen", f"q{k} <= 1/2")
            text += f'      - {{name: "tank[{k}].{name}", when: {when}, to: {target}}}\n'
    return text + "initial: {mode: open_open, q1: 1/4, q2: 1/2}\nexperiment: {until: 6}\n"


@pytest.mark.parametrize("way", [{}, {"method": "radau", "tolerance": 1e-9}])
def test_equations_of_the_file_reach_through_parts(way):
    found, expected = (hsdsl.loads(text).simulate(**way) for text in (MANIFOLD, flat_manifold()))
    assert len(expected.transitions) > 3
    assert [made.edge for made in found.transitions] == [made.edge for made in expected.transitions]
    assert [t.time for t in found.transitions] == pytest.approx([t.time for t in expected.transitions], abs=1e-8)
    assert list(found.final.state.values()) == pytest.approx(list(expected.final.state.values()), abs=1e-8)
    assert found.final.outputs["p"] == pytest.approx(expected.final.outputs["p"], abs=1e-8)


TURNING = """
hsdsl: 1
automata:
  counter:
    modes:
      up: {flow: {x: 1}, transitions: [{name: hit, when: x >= 2/3, to: down, reset: {x: x - 1/3}}]}
      down: {flow: {x: -1}, transitions: [{name: hit, when: x <= 0, to: up, reset: {x: x + 1/5}}]}
system:
  a: {automaton: counter, initial: {mode: up, x: 1/10}}
  b: {automaton: counter, initial: {mode: up, x: 1/10}}
experiment: {until: 4}
"""


@pytest.mark.parametrize("engine", ["c", "python"])
def test_tied_parts_commute_also_where_modes_name_transitions_alike(engine):
    run = hsdsl.loads(TURNING).simulate(engine=engine)
    assert len(run.transitions) > 8
    assert run.verdict.theorem == "holds"
    assert any("every order leads to the same point" in reason for reason in run.verdict.reasons)


RING = """
hsdsl: 1
automata:
  cell:
    inputs: [before]
    modes:
      run:
        flow: {p: 0.5 + 0.1*index + 0.01*before, hits: 0}
        transitions:
          - {name: wrap, when: p >= 1, reset: {p: 0}}
          - {name: hear, on: "c[index - 1].wrap", reset: {p: 0.9*p, hits: hits + 1}}
          - {name: back, on: "c[index + 1].wrap", reset: {hits: hits + 100}}
system:
  c:
    automaton: cell
    count: 4
    initial: {p: 0.1*index, hits: 0}
    inputs: {before: "c[index - 1].p"}
    at_ends: {p: "c[select(index, 1, 4)].p", wrap: "c[select(index, 1, 4)].wrap"}
experiment: {until: 5}
"""


def test_a_ring_is_closed_by_its_ends():
    """The same cells, each with its neighbours by name."""
    names = [f"c{k}" for k in range(1, 5)]
    cell = RING.split("automata:")[1].split("system:")[0]
    kinds, instances = "", ""
    for k, name in enumerate(names):
        kind = cell.replace("cell:", f"k{k}:").replace("index", str(k + 1), 1)
        kind = kind.replace('"c[index - 1].wrap"', f"{names[k - 1]}.wrap")
        kinds += kind.replace('"c[index + 1].wrap"', f"{names[(k + 1) % 4]}.wrap")
        start = f"initial: {{p: {0.1 * (k + 1)}, hits: 0}}"
        instances += f"  {name}: {{automaton: k{k}, {start}, inputs: {{before: {names[k - 1]}.p}}}}\n"
    apart = hsdsl.loads(f"hsdsl: 1\nautomata:{kinds}system:\n{instances}experiment: {{until: 5}}").simulate()
    ring = hsdsl.loads(RING).simulate()
    assert [float(t.time) for t in ring.transitions] == pytest.approx([float(t.time) for t in apart.transitions])
    for k, name in enumerate(names):
        for state in ("p", "hits"):
            assert ring.final.state[f"c[{k + 1}].{state}"] == pytest.approx(apart.final.state[f"{name}.{state}"])
    assert min(ring.final.state[f"c[{k}].hits"] for k in (1, 4)) > 100


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("at_ends: {p:", "at_ends: {q: 3, p:", "nothing reads 'q' beyond the ends of 'c'"),
        ("at_ends: {p:", "at_ends: {hits: 3, p:", "nothing reads 'hits' beyond the ends of 'c'"),
        ("wrap: ", "wraps: ", "nothing reads 'wraps' beyond the ends of 'c' (did you mean 'wrap'?)"),
        ("1, 4)].wrap", "1, 4)].warp", "has no transition 'warp' (did you mean 'wrap'?)"),
        ("1, 4)].wrap", "4, 1)].wrap", "'c[select(index, 4, 1)].wrap' is a transition of 'c[1]' itself"),
        ('wrap: "c[select(index, 1, 4)].wrap"', "wrap: 3", "expected an instance and its transition, got '3'"),
    ],
)
def test_ends_that_mean_nothing_are_reported(old, new, says):
    with pytest.raises(hsdsl.ModelError) as error:
        hsdsl.loads(RING.replace(old, new))
    assert says in str(error.value)
