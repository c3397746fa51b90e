"""Parameters by what a change of them needs: which others decide, which decide when inputs change; as C functions."""

from __future__ import annotations

import re
from collections.abc import Iterable

from hsdsl.backends.c import constant_bodies
from hsdsl.export.c.starts import starts
from hsdsl.export.c.text import array, function
from hsdsl.program import Program
from hsdsl.simulate import Problem

_ROUTINE = re.compile(r"^    def (\w+)\(\*?\w*\):\n(.*?)(?=^    (?:def|return) )", re.MULTILINE | re.DOTALL)
_GIVEN = re.compile(r"\bgiven\[(\d+)\]")
_NUMBERED = re.compile(r"\bp(\d+)\b")

_DERIVE = """
int problem_derive(hs_real *p) {{
  int bad = 0;
  (void)p;
{calls}
  return bad;
}}
"""


def derived(problem: Problem) -> set[str]:
    """The parameters that are expressions of others, and not overridden."""
    program = problem.program
    used = used_by(program)
    return {
        name
        for i, name in enumerate(program.parameters)
        if used.get(f"parameter_{i}") and name not in problem.settings.overrides
    }


def structural(problem: Problem) -> set[str]:
    """The parameters that decide the samples of inputs or when switches of time change; such times are data."""
    program, own = problem.program, derived(problem)
    used = used_by(program)
    direct = {i for name, needed in used.items() if name.startswith("input_") for i in needed}
    body = program.switching.source.partition("\n")[2]
    direct |= {int(i) for i in _NUMBERED.findall(body)}
    return {program.parameters[i] for i in with_sources(program, used, own, direct)}


def used_by(program: Program) -> dict[str, set[int]]:
    """The parameters that each constant is computed from."""
    texts: Iterable[tuple[str, str]] = _ROUTINE.findall(program.constants.source)
    return {name: {int(i) for i in _GIVEN.findall(body)} for name, body in texts}


def with_sources(program: Program, used: dict[str, set[int]], own: set[str], direct: set[int]) -> set[int]:
    """Parameters with those that they are derived from, which come before them."""
    found = set(direct)
    for i in reversed(range(len(program.parameters))):
        if i in found and program.parameters[i] in own:
            found |= used[f"parameter_{i}"]
    return found


def derivations(problem: Problem) -> str:
    """The definitions of ``problem_derive`` and ``problem_start``, and of what kind each parameter is."""
    program = problem.program
    bodies, own, fixed = constant_bodies(program), derived(problem), structural(problem)
    flags = array("const int", "problem_derived", (str(int(name in own)) for name in program.parameters))
    flags += array("const int", "problem_structural", (str(int(name in fixed)) for name in program.parameters))
    functions, calls = list[str](), list[str]()
    for i, name in enumerate(program.parameters):
        if name in own:
            functions.append(function(f"parameter_{i}", "const hs_real *p", bodies[f"parameter_{i}"]))
            calls.append(f"  bad |= parameter_{i}(p, p + {i});")
    return flags + "".join(functions) + _DERIVE.format(calls="\n".join(calls)) + starts(problem)
