"""Large models: what is written of a model grows with it, not with its square."""

from __future__ import annotations

import pytest
from sympy.core import relational

from hsdsl.engine.backends.c.source import model_source
from hsdsl.language.elaborate import elaborate
from hsdsl.mathematics.lower import lower


def ring(n: int) -> str:
    flow = ", ".join(f"x{i}: x{(i + 1) % n} - x{i}" for i in range(n))
    return f"modes: {{m: {{flow: {{{flow}}}}}}}\ninitial: {{mode: m, {zeros(n)}}}"


def ring_with_a_guard(n: int) -> str:
    flow = ", ".join(f"x{i}: x{(i + 1) % n}*x{i}" for i in range(n))
    edge = "transitions: [{when: x0 >= 5, to: m, reset: {x0: x1}}]"
    return f"modes: {{m: {{flow: {{{flow}}}, {edge}}}}}\ninitial: {{mode: m, {zeros(n)}}}"


def chain_of_parameters(n: int) -> str:
    chain = "".join(f", p{i}: p{i - 1} + 1" for i in range(1, n))
    return f"parameters: {{p0: 1{chain}}}\nmodes: {{m: {{flow: {{x: p{n - 1}}}}}}}\ninitial: {{mode: m, x: 0}}"


def ring_of_modes(n: int) -> str:
    edges = (f"m{i}: {{flow: {{x: 1}}, transitions: [{{when: x >= {i}, to: m{(i + 1) % n}}}]}}" for i in range(n))
    return f"modes: {{{', '.join(edges)}}}\ninitial: {{mode: m0, x: 0}}"


def zeros(n: int) -> str:
    return ", ".join(f"x{i}: 0" for i in range(n))


@pytest.mark.parametrize("model", [ring, ring_with_a_guard, chain_of_parameters, ring_of_modes])
def test_text_grows_with_the_model(model):
    sizes = []
    for n in (60, 120):
        text = f"hsdsl: 1\n{model(n)}\nexperiment: {{until: 1}}\n"
        program = lower(elaborate("large.yaml", text=text.encode()))
        sizes.append(len(repr(program)) + len(model_source(program)))
    assert sizes[1] < 2.4 * sizes[0]  # numbers with more digits; a square would be 4


def test_conditions_are_lowered_without_a_proof_of_which_side_is_larger(monkeypatch):
    edge = "{when: x >= 2, if: (1 - x)*(2 - y)*(3 - z) >= 1/2, to: m}"
    text = f"hsdsl: 1\nmodes: {{m: {{flow: {{x: 1, y: 1, z: 1}}, transitions: [{edge}]}}}}\n"
    text += "initial: {mode: m, x: 0, y: 0, z: 0}\nexperiment: {until: 1}\n"
    system, asked = elaborate("proof.yaml", text=text.encode()), []
    monkeypatch.setattr(relational, "is_ge", lambda *sides: asked.append(sides))
    assert lower(system).modes[0].conditions == (("condition_0_0",),) and not asked
