#!/usr/bin/env bash
# What decides which event other tools see: diffrax 0.7.2, CasADi 3.8.2, heyoka 7.13.2 and scikit-SUNDAE 1.2.0 on x' = 1
# from 0, whose solution is x = t. Exits with 0 while each does as the gallery says.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  diffrax==0.7.2 casadi==3.8.2 heyoka==7.13.2 scikit-sundae==1.2.0 2> /dev/null
"$folder/venv/bin/python" -W ignore - 2> /dev/null << 'PYTHON'
import sys

import casadi as ca
import diffrax as dx
import heyoka as hy
import jax
import numpy as np
import optimistix as optx
import sksundae as sun

jax.config.update("jax_enable_x64", True)
seen = []


def show(sentence, holds):
    print("yes" if holds else "NO ", sentence)
    seen.append(bool(holds))


def stopped(levels):
    """diffrax: where one step of length 1 ends that crosses all of these levels."""
    conditions = [lambda t, y, args, level=level, **_: y - level for level in levels]
    event = dx.Event(conditions, optx.Newton(1e-12, 1e-12), direction=[True] * len(levels))
    return float(dx.diffeqsolve(dx.ODETerm(lambda t, y, args: 1.0), dx.Tsit5(), 0.0, 1.0, 1.0, 0.0, event=event).ts[-1])


show("diffrax: of two guards crossed in one step the first of the list ends it, not the earlier one",
     abs(stopped([0.7, 0.2]) - 0.7) < 1e-9 and abs(stopped([0.2, 0.7]) - 0.2) < 1e-9)

t, x, nothing = ca.SX.sym("t"), ca.SX.sym("x"), [ca.SX(0, 1)] * 3
after = ca.Function("transition", [ca.SX.sym("index"), t, x, *nothing], [x + 100, ca.SX(0, 1)],
                    ["index", "t", "x", "z", "p", "u"], ["post_x", "post_z"])


def fires(zero, grid, method):
    """CasADi: whether an event has added 100 by the last time."""
    problem = {"t": t, "x": x, "ode": ca.SX(1), "zero": zero}
    run = ca.integrator("run", method, problem, 0.0, grid, {"transition": after, "max_events": 5})
    return float(run(x0=0.0)["xf"][-1]) > 50


both = ("rosenbrock", "rk")
show("CasADi: an event is where `zero` falls through zero, not where it rises",
     all(fires(0.5 - x, [1.0], m) and not fires(x - 0.5, [1.0], m) for m in both))
show("CasADi: a `zero` that is zero at the start and falls is no event",
     not fires(-x, [1.0], "rosenbrock") and fires(1e-9 - x, [1.0], "rosenbrock"))
show("CasADi: rk loses an event that is on an output time", fires(0.25 - x, [1.0], "rk")
     and not fires(0.25 - x, [0.25, 1.0], "rk") and fires(0.25 - x, [0.25, 1.0], "rosenbrock"))

v, rising = hy.make_vars("x"), hy.event_direction.positive


def end(power):
    """heyoka: where a run to 2 ends that rises through a root of this order at 1."""
    run = hy.taylor_adaptive([(v, hy.expression(1.0))], [0.0], t_events=[hy.t_event((v - 1) ** power, direction=rising)])
    run.propagate_until(2.0)
    return run.time


show("heyoka: an event with a direction passes a triple root, where the derivative is zero", end(1) == 1 and end(3) == 2)


def slope(time, y, yp):
    yp[0] = 1.0


def half(time, y, events):
    events[0] = y[0] - 0.5


half.terminal, half.direction = [2], [1]
solver = sun.cvode.CVODE(slope, eventsfn=half, num_events=1)
ends = [float(solver.solve(np.array([0.0, 1.0]), np.array([0.0])).t[-1]) for _ in range(2)]
show("scikit-SUNDAE: a solver counts the events of earlier calls: the second call ends at its first event",
     abs(ends[0] - 1) < 1e-9 and abs(ends[1] - 0.5) < 1e-6)
sys.exit(not all(seen))
PYTHON
