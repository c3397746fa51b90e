"""Time boxes around symbolic work."""

import threading
import time

import pytest
import sympy as sp

from hsdsl import limits
from hsdsl.elaborate import elaborate
from hsdsl.errors import ModelError, UsageError
from hsdsl.expression import symbolic
from hsdsl.expression.timebox import OutOfTime, timebox
from hsdsl.limits import Limits, applied
from hsdsl.lower import lower

MODEL = b"""hsdsl: 1
modes: {A: {flow: {x: 1, v: sin(x)}}}
initial: {mode: A, x: 0, v: 0}
experiment: {until: 1}
"""


def busy(*_, **__):
    while True:
        sum(range(100))


def test_work_is_cut_short():
    began = time.process_time()
    with pytest.raises(OutOfTime), timebox(0.1):
        busy()
    assert time.process_time() - began < 2


def test_each_part_has_its_own_time():
    with timebox(2.0, parts=4) as box:
        for _ in range(3):
            end = time.process_time() + 0.2
            while time.process_time() < end:
                pass
            box.restart()
    with pytest.raises(OutOfTime), timebox(2.0, parts=20):
        busy()


def test_the_whole_ends_at_the_next_part():
    with pytest.raises(OutOfTime), timebox(0.02) as box:
        while True:
            box.restart()


def test_it_works_in_any_thread():
    caught = []

    def work():
        try:
            with timebox(0.05):
                busy()
        except OutOfTime:
            caught.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join(20)
    assert caught == [True]


def test_nothing_arrives_afterwards():
    for _ in range(200):
        with timebox(5.0):
            pass
    end = time.process_time() + 0.05
    while time.process_time() < end:
        pass


def test_an_expression_that_takes_too_long_is_an_error_at_its_place(monkeypatch):
    made = symbolic._Builder.made
    monkeypatch.setattr(
        symbolic._Builder, "made", lambda self, tree, f, *a: busy() if f is sp.sin else made(self, tree, f, *a)
    )
    with pytest.raises(ModelError) as raised, applied(Limits(seconds=1.5)):
        elaborate("m.yaml", text=MODEL)
    (found,) = raised.value.diagnostics
    assert (found.code, found.span.line, found.span.column) == ("HS122", 2, 29)
    assert "--limit seconds" in found.hint


def test_lowering_that_takes_too_long_is_an_error(monkeypatch):
    system = elaborate("m.yaml", text=MODEL)
    monkeypatch.setattr("hsdsl.lower.print_routines", busy)
    with pytest.raises(ModelError) as raised, applied(Limits(seconds=0.1)):
        lower(system)
    assert [d.code for d in raised.value.diagnostics] == ["HS122"]


def test_limits_are_positive():
    with pytest.raises(UsageError):
        Limits(seconds=0)
    assert limits.current() == limits.DEFAULT
