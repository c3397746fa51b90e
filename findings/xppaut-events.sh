#!/usr/bin/env bash
# When `global` events of XPPAUT 6.11 (Debian 12) happen, against closed forms. Its manual says: when the condition
# changes from negative to positive (sign 1).
#
# - If a step ends where the condition is 0, the event is lost: the value before is not positive, and the value after is
#   not negative. With x' = 1 and dt = 0.25 or 0.1, `global 1 {x-1} {x=0}` never resets. `global 1 {t-10} {..}` happens at
#   dt = 0.1 and not at the default dt = 0.05: the round-off of the sum of the steps decides.
# - A comparison as the condition, such as {x>1}, is 0 or 1, so it never becomes positive from negative: no event.
# - Time and state of an event are on the chord of a step of length dt, with every method and tolerance: a ball hits the
#   floor 2.2e-4 s early at dt = 0.05 and 2.2e-6 s at dt = 0.005, also with cvode at a tolerance of 1e-10.
#
# A threshold off the grid, {x-1-1e-9}, mends the first; a small dt the last. Exits with 0 while this is so.
set -euo pipefail
command -v xppaut > /dev/null || apt-get install --yes --no-install-recommends xppaut=6.11b+1.dfsg-1.1 > /dev/null
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
cat > run.py << 'PYTHON'
import math
import subprocess
import sys

seen = []


def show(sentence, holds):
    print("yes" if holds else "NO ", sentence)
    seen.append(bool(holds))


def last(equations, event, dt, total, method="rungekutta", options=""):
    """The last row of a run: the time and the variables."""
    with open("model.ode", "w") as file:
        file.write(f"{equations}\nglobal {event}\n@ meth={method}, dt={dt}, total={total}{options}\n@ maxstor=100000\ndone\n")
    made = subprocess.run(["xppaut", "model.ode", "-silent", "-outfile", "rows"], capture_output=True, text=True)
    if made.returncode or "Run complete" not in made.stdout:
        sys.exit(made.stdout + made.stderr)
    with open("rows") as file:
        return tuple(map(float, file.readlines()[-1].split()))


def resets(condition, dt, method="rungekutta"):
    """How often x with x' = 1 is reset by this condition until 9.5."""
    return last("x'=1\nn'=0", f"1 {{{condition}}} {{x=x-1;n=n+1}}", dt, 9.5, method)[-1]


def doses(time, dt):
    return last("n'=0", f"1 {{t-{time}}} {{n=n+1}}", dt, 60)[-1]


methods = ("rungekutta", "cvode")
show("a saw tooth that should be reset nine times never is, at steps of 0.25 and 0.1",
     all(resets("x-1", dt, method) == 0 for dt in (0.25, 0.1) for method in methods))
show("with the threshold at 1 + 1e-9 it is reset nine times",
     all(resets("x-1-1e-9", dt, method) == 9 for dt in (0.25, 0.1) for method in methods))
show("with {x>1} or {x>=1} it never is", not any(resets(f"x{sign}1", dt) for sign in (">", ">=") for dt in (0.25, 0.03)))
table = {dt: [doses(time, dt) for time in (1, 2, 5, 10, 12.5, 20, 25, 50)] for dt in (0.05, 0.1)}
for dt, row in table.items():
    print(f"     doses given at t = 1, 2, 5, 10, 12.5, 20, 25, 50 with dt = {dt}:", *map(int, row))
show("an event at t = 10 is lost at dt = 0.05 and happens at 0.1; one at t = 20 is lost at both",
     (table[0.05][3], table[0.1][3], table[0.05][5], table[0.1][5]) == (0, 1, 0, 0))
exact = math.sqrt(20 / 9.81)
late = {
    (method, dt): last("x'=v\nv'=-9.81\nhit'=0\ninit x=10", "-1 {x} {x=0;v=-0.8*v;hit=t}", dt, 2, method, options)[-1] - exact
    for method, options in (("rungekutta", ""), ("cvode", ", tol=1e-10, atol=1e-10"))
    for dt in (0.05, 0.005)
}
print("     the first impact of a ball is late by", *(f"{value:.2g} s ({name}, dt = {dt})" for (name, dt), value in late.items()))
show("it is early by 2.2e-4 at dt = 0.05 and by 2.2e-6 at 0.005, by both methods",
     all(abs(value / (-0.088 * dt**2) - 1) < 0.05 for (_, dt), value in late.items()))
sys.exit(not all(seen))
PYTHON
python3 run.py
