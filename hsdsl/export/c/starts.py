"""Parameters and initial values that follow others, as C functions ``problem_derive`` and ``problem_start``."""

from __future__ import annotations

from hsdsl.engine.backends.c import constant_bodies, initial_bodies
from hsdsl.engine.simulate import Problem
from hsdsl.export.c.text import array, function
from hsdsl.export.parameters import derived, given, structural

_DERIVE = """
int problem_derive(hs_real *p) {{
  int bad = 0;
  (void)p;
{calls}
  return bad;
}}
"""
_START = """
/* See hsdsl/engine/preparation/values.py: initial_columns. */
int problem_start(const hs_real *p, const char *given, hs_real *x) {{
  hs_real row[PROBLEM_PARAMETERS + {width}] = {{0}}, own[{width}] = {{0}}, *const initial = row + PROBLEM_PARAMETERS;
  char known[{width}] = {{0}};
  int any = 0, bad = 0;
  for (int i = 0; i < PROBLEM_PARAMETERS; i++) row[i] = p[i];
  for (int i = 0; i < {starts}; i++) {{
    if (!given[i]) continue;
    any = 1;
    if (start_place[i] >= 0) initial[start_place[i]] = x[i], known[start_place[i]] = 1;
  }}
  if (any && {followers}) {{
    for (int k = 0; k < {followers}; k++)
      if (!known[follower[k]]) bad |= following[k](row, initial + follower[k]);
  }} else {{
    bad = initial_values(p, own);
    for (int k = 0; k < {states}; k++)
      if (!known[k]) initial[k] = own[k];
  }}
  for (int i = 0; i < {starts}; i++)
    if (!given[i] && start_place[i] >= 0) x[i] = initial[start_place[i]];
  return bad;
}}
"""


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
    return flags + "".join(functions) + _DERIVE.format(calls="\n".join(calls)) + _starts(problem)


def _starts(problem: Problem) -> str:
    """The definitions of ``problem_given`` and ``problem_start``."""
    program = problem.program
    known, chosen = program.initial_states, given(problem)
    bodies = {"initial_values": constant_bodies(program)["initial"]} | initial_bodies(program)
    text = "".join(function(name, "const hs_real *p", body) for name, body in bodies.items())
    text += array(
        "static const int", "start_place", (str(known.index(n) if n in known else -1) for n in problem.states)
    )
    text += array("static const int", "follower", map(str, program.initial_order))
    pointers = (f"initial_{i}" for i in program.initial_order)
    text += array("static int (*const", "following", pointers, ")(const hs_real *, hs_real *)")
    text += array("const char", "problem_given", (str(int(name in chosen)) for name in problem.states))
    return text + _START.format(
        width=len(known) + 1, states=len(known), starts=len(problem.states), followers=len(program.initial_order)
    )
