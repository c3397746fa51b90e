"""Simultaneous events of equal priority in files of SBML: a seed draws their order, fairly and anew each time."""

from __future__ import annotations

from collections import Counter
from itertools import permutations
from math import factorial
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

import hsdsl
from hsdsl.interface.cli.verbs import obey
from hsdsl.interface.imports.sbml import DEEPEST, imported
from hsdsl.interface.imports.sbml.order import MOST
from hsdsl.language.source.xml import read_xml

HEAD = '<sbml xmlns="http://www.sbml.org/sbml/level3/version2/core" level="3" version="2"><model>'
MATH = '<math xmlns="http://www.w3.org/1998/Math/MathML">{}</math>'
TIME = '<csymbol encoding="text" definitionURL="http://www.sbml.org/sbml/symbols/time">t</csymbol>'
CLEAR = 0.999  # of the chi-square distribution


def of(head: str, *parts: str) -> str:
    return f"<apply><{head}/>{''.join(parts)}</apply>"


def name(word: str) -> str:
    return f"<ci>{word}</ci>"


def number(value: float) -> str:
    return f"<cn>{value}</cn>"


def event(
    word: str,
    trigger: str,
    priority: str,
    changes: dict[str, str],
    lasting: bool = False,
    delay: str = "",
    old: bool = False,
) -> str:
    """An event, by default one that ends where its trigger turns false; ``old`` are values of its trigger."""
    begins = f'<trigger initialValue="true" persistent="{str(lasting).lower()}">{MATH.format(trigger)}</trigger>'
    ranked = f"<priority>{MATH.format(priority)}</priority>" if priority else ""
    later = f"<delay>{MATH.format(delay)}</delay>" if delay else ""
    items = "".join(f'<eventAssignment variable="{n}">{MATH.format(f)}</eventAssignment>' for n, f in changes.items())
    given = f'id="{word}" useValuesFromTriggerTime="{str(old).lower()}"'
    return f"<event {given}>{begins}{later}{ranked}<listOfEventAssignments>{items}</listOfEventAssignments></event>"


def text_of(values: dict[str, float], events: list[str], until: float, seed: int = 1, constants: str = "") -> str:
    given = "".join(f'<parameter id="{word}" value="{value}" constant="false"/>' for word, value in values.items())
    lists = f"<listOfParameters>{given}{constants}</listOfParameters><listOfEvents>{''.join(events)}</listOfEvents>"
    file = f"{HEAD}{lists}</model></sbml>"
    return imported(read_xml("model.xml", file.encode(), DEEPEST), str(until), seed=seed)


def rivals(count: int, priorities: list[str] | None = None, **kind: bool | str) -> tuple[dict[str, float], list[str]]:
    """Events that are due each second, of which one is made: it counts itself in `n0`, `n1`, and is the `last` one."""
    ranks = priorities or [number(1)] * count
    due = of("geq", of("minus", TIME, name("before")), number(1))
    events = [
        event(
            f"e{i}",
            due,
            rank,
            {"before": TIME, f"n{i}": of("plus", name(f"n{i}"), number(1)), "last": number(i)},
            **kind,
        )
        for i, rank in enumerate(ranks)
    ]
    return dict.fromkeys((f"n{i}" for i in range(count)), 0.0) | {"before": 0.0, "last": -1.0}, events


def winners(text: str | hsdsl.Model, changed: dict[str, float] | None = None) -> list[int]:
    """Which event was made each second."""
    model = hsdsl.loads(text) if isinstance(text, str) else text
    run = model.simulate(parameters=changed or {}, tolerance=1e-6)
    return [int(made.edge[1:]) for made in run.transitions if made.edge[0] == "e" and " " not in made.edge]


def unlikely(counts: list[int], expected: float) -> bool:
    return bool(sum((c - expected) ** 2 for c in counts) / expected > chi2.ppf(CLEAR, len(counts) - 1))


@pytest.mark.parametrize("old", [False, True], ids=["values of the execution", "values of the trigger"])
@pytest.mark.parametrize("count", [2, 3, 5])
def test_each_of_tied_events_is_as_likely_whatever_went_before(count: int, old: bool) -> None:
    """One in `count`, and so after each of the others; neighbours in the file and in time have nothing in common."""
    made = winners(text_of(*rivals(count, old=old), until=1500.5))
    assert len(made) == 1500
    single = Counter(made)
    assert not unlikely([single[i] for i in range(count)], len(made) / count)
    pairs = Counter(zip(made[::2], made[1::2], strict=True))
    assert not unlikely([pairs[i, j] for i in range(count) for j in range(count)], len(made) / 2 / count**2)


def test_every_order_of_lasting_events_is_as_likely() -> None:
    """Four events that all are made at each instant: each draws anew, and every permutation comes as often."""
    due = of("gt", of("sin", TIME), number(0))
    step = {"place": of("plus", name("place"), number(1))}
    events = [event(f"e{i}", due, number(2), {f"p{i}": name("place"), **step}, lasting=True) for i in range(4)]
    values = dict.fromkeys([f"p{i}" for i in range(4)], 0.0) | {"place": 0.0}
    made = winners(text_of(values, events, until=2 * np.pi * 480 + 1))
    orders = Counter(tuple(made[i : i + 4]) for i in range(0, len(made), 4))
    assert set(orders) <= set(permutations(range(4)))
    assert not unlikely([orders[each] for each in permutations(range(4))], len(made) / 4 / factorial(4))


def test_a_seed_repeats_and_another_one_changes() -> None:
    """Also as a parameter of the model; seeds that are neighbours are as good as independent."""
    values, events = rivals(2)
    text = text_of(values, events, 64.5)
    first = [winners(text_of(values, events, 64.5, seed)) for seed in (1, 2, 1)]
    assert first[0] == first[2] != first[1] == winners(text, {"seed": 2})
    model = hsdsl.loads(text)
    begins = [tuple(winners(model, {"seed": seed})[:2]) for seed in range(1, 161)]
    assert not unlikely([Counter(begins)[i, j] for i in range(2) for j in range(2)], 40)


def test_higher_priorities_go_first_where_some_are_no_numbers() -> None:
    """By a state that is 0, 1 or 2 against 1, and by a constant parameter of the same value."""
    values, events = rivals(2, [name("x"), number(1)])
    made = {}
    for x in (0.0, 1.0, 2.0):
        made[x] = Counter(
            winners(
                text_of(
                    values | {"x": x},
                    [*events, event("sets", of("gt", TIME, number(1e6)), "", {"x": number(x)})],
                    300.5,
                )
            )
        )
    assert made[0.0] == {1: 300} and made[2.0] == {0: 300} and not unlikely([made[1.0][0], made[1.0][1]], 150)
    constant = '<parameter id="k" value="0.25" constant="true"/>'
    values, events = rivals(3, [name("k"), number(0.25), number(0.2)])
    chosen = Counter(winners(text_of(values, events, 300.5, constants=constant)))
    assert chosen[2] == 0 and not unlikely([chosen[0], chosen[1]], 150)
    values, events = rivals(3, [number(0.25), number(0.25), number(0.2)])
    chosen = Counter(winners(text_of(values, events, 300.5)))
    assert chosen[2] == 0 and not unlikely([chosen[0], chosen[1]], 150)


@pytest.mark.parametrize(
    "events",
    [
        [event("one", of("geq", TIME, number(1)), number(1), {"x": number(1)})],
        [event(f"e{i}", of("geq", TIME, number(1)), number(i), {"x": number(i)}) for i in range(3)],
        [event(f"e{i}", of("geq", TIME, number(1)), number(1), {word: number(1)}) for i, word in enumerate("xy")],
        [event(f"e{i}", of("geq", TIME, number(1)), "", {"x": number(i)}) for i in range(2)],
    ],
    ids=["one event", "different priorities", "no effect on each other", "no priorities"],
)
def test_models_without_such_a_choice_have_no_seed(events: list[str]) -> None:
    text = text_of({"x": 0.0, "y": 0.0}, events, 2)
    assert "seed" not in text and "floor" not in text and not hsdsl.loads(text).simulate().warnings


def test_an_effect_through_a_third_event_counts() -> None:
    """The third one reads what both change: the order decides whether it sees one of them alone."""
    due = of("geq", TIME, number(1))
    pair = [event(f"e{i}", due, number(1), {word: number(1)}) for i, word in enumerate("xy")]
    third = event("seen", of("gt", name("x"), name("y")), number(9), {"z": number(1)}, lasting=True)
    model = hsdsl.loads(text_of({"x": 0.0, "y": 0.0, "z": 0.0}, [*pair, third], 2))
    ends = {model.simulate(parameters={"seed": seed}, engine="python").final.state["z"] for seed in range(1, 9)}
    assert ends == {0.0, 1.0}


def test_the_order_of_many_is_that_of_the_file() -> None:
    """Each event is compared with each: a model says so where these are too many."""
    text = text_of(*rivals(MOST + 1), until=9.5)
    assert f"equal priority is that of the file: e0, e1 and {MOST - 1} more" in text and "seed" not in text
    assert "drawn by `seed`: e0, e1 and" in text_of(*rivals(MOST), until=9.5)


def test_the_command_takes_a_seed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values, events = rivals(2)
    given = "".join(f'<parameter id="{word}" value="{value}" constant="false"/>' for word, value in values.items())
    file = tmp_path / "choice.xml"
    file.write_text(
        f"{HEAD}<listOfParameters>{given}</listOfParameters><listOfEvents>{''.join(events)}</listOfEvents></model></sbml>"
    )
    assert obey(["import", str(file), "--until", "9", "--seed", "12"]) == 0
    assert "\n  seed: 12  # from 1 to 2147483646: " in capsys.readouterr().out
    assert obey(["import", str(file), "--until", "9", "--seed", "0"]) == 2
    assert "--seed: expected a whole number from 1 to 2147483646, got 0" in capsys.readouterr().err
