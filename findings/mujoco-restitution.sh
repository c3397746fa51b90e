#!/usr/bin/env bash
# With which share of its speed MuJoCo 3.3.7 throws a ball back, for contacts `solref="0.02 DAMPING_RATIO"`.
#
# At short time steps it is that of a spring and a damper that never pull (Schwager and Pöschel 2007), not
# exp(-pi z/sqrt(1 - z^2)), and independent of mass and speed. At the default time step of 2 ms a damping ratio of 0.05
# or 0.01 gives a ball that leaves faster than it came, 2 and 73 times as fast, and no warning: the stiffness is
# 1/(time constant * damping ratio)^2. Exits with 0 while that is so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mujoco==3.3.7 2> /dev/null
"$folder/venv/bin/python" - << 'PYTHON'
import sys
from math import atan2, exp, pi, sqrt

import mujoco

SCENE = """
<mujoco>
  <option timestep="{step}" integrator="{method}"/>
  <worldbody>
    <geom type="plane" size="5 5 1" solref="{contact}"/>
    <body pos="0 0 1.1">
      <joint type="slide" axis="0 0 1"/>
      <geom type="sphere" size="0.1" mass="{mass}" solref="{contact}"/>
    </body>
  </worldbody>
</mujoco>"""


def rebound(ratio, step, method="Euler", mass=1):
    """The speed after the first contact, relative to that before; the ball falls from a height of 1."""
    text = SCENE.format(step=step, method=method, contact=f"0.02 {ratio}", mass=mass)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    fastest = slowest = 0.0
    while data.time < 0.8:
        mujoco.mj_step(model, data)
        slowest = min(slowest, data.qvel[0]) if fastest == 0 else slowest
        fastest = max(fastest, data.qvel[0])
    return -fastest / slowest


def law(z):
    """The share for a spring and a damper that never pull."""
    w = sqrt(1 - z * z)
    return exp(-2) if z == 1 else exp(-z / w * (pi - atan2(2 * z * w, w * w - z * z)))


print(f"MuJoCo {mujoco.__version__}\nratio    law  step 1e-5   2e-3  2e-3, RK4")
short, default = {}, {}
for z in (1, 0.5, 0.2, 0.1, 0.05, 0.01):
    short[z], default[z] = rebound(z, 1e-5), rebound(z, 2e-3)
    print(f"{z:5} {law(z):6.3f} {short[z]:10.3f} {default[z]:6.3f} {rebound(z, 2e-3, 'RK4'):10.3f}")
seen = {
    "at a step of 1e-5 all are within 0.002 of the law": all(abs(short[z] - law(z)) < 2e-3 for z in short),
    "the mass does not matter": abs(rebound(0.1, 1e-5, mass=50) - short[0.1]) < 1e-9,
    "at the default step a ball with a damping ratio of 0.05 leaves more than twice as fast as it came":
        default[0.05] > 2,
    "with 0.01, more than 50 times as fast": default[0.01] > 50,
}
for sentence, holds in seen.items():
    print("yes" if holds else "NO ", sentence)
sys.exit(not all(seen.values()))
PYTHON
