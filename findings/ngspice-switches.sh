#!/usr/bin/env bash
# When ngspice 39.3 (Debian 12) switches, against closed forms.
#
# - PULSE with a rise time of 0 rises within the print step TSTEP of .tran, and likewise falls. A source that is to be
#   on for 8 of 20 us has the mean of one that is on for 8 us + TSTEP, whatever TMAX is: 12.5 % more at TSTEP = 1 us.
# - A switch with hysteresis acts at the start of the internal step that passes its threshold, not at the threshold. A
#   relaxation oscillator runs 1.25 % too fast at TSTEP = 10 us, a hundredth of its period; RELTOL changes this little,
#   TMAX decides.
#
# A rise time of 1 ns, and a TMAX of a ten-thousandth of the period, agree to 2e-4 and 1e-5. Exits with 0 while that is so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download ngspice=39.3+ds-1 > /dev/null 2>&1
dpkg -x ngspice_*.deb .
cat > run.py << 'PYTHON'
import math
import subprocess
import sys


def run(net):
    with open("net.cir", "w") as file:
        file.write(net)
    return subprocess.run(["./usr/bin/ngspice", "-b", "net.cir"], capture_output=True, text=True).stdout


def mean(step, rise, most=""):
    """The mean voltage that a buck converter's filter gets, 12 V for 8 of 20 us: exactly 4.8."""
    printed = run(f"""* buck
V1 a 0 PULSE(0 12 0 {rise} {rise} 8u 20u)
L1 a c 100u IC=0
C1 c 0 1u IC=4.8
R1 c 0 20
.tran {step} 4m 3m {most} UIC
.control
run
meas tran mean AVG v(c) from=3m to=4m
.endc
.end
""")
    return next(float(line.split()[2]) for line in printed.splitlines() if line.startswith("mean "))


R, LOW, LEAK, ON, SOURCE, C = 1000.0, 3.0, 100.0, 1e-3, 10.0, 1e-6


def period(step, most="", options=""):
    """The period of a relaxation oscillator between 3 and 7 V, a mean of nine."""
    run(f"""* oscillator
V1 a 0 {SOURCE}
R1 a c {R}
C1 c 0 {C} IC=0
S1 c d c 0 SW OFF
R2 d 0 {LEAK}
.model SW SW(Ron={ON} Roff=1e12 vt=5 vh=2)
.options {options}
.tran {step} 10m 0 {most} UIC
.control
run
wrdata out v(c)
.endc
.end
""")
    with open("out") as file:
        rows = [tuple(map(float, line.split())) for line in file]
    tops = [b[0] for a, b, c in zip(rows, rows[1:], rows[2:]) if b[1] > a[1] and b[1] >= c[1]]
    return (tops[9] - tops[0]) / 9


leak = LEAK + ON
rest, rate = SOURCE * leak / (R + leak), R * C * leak / (R + leak)
exact = R * C * math.log(7 / 3) + rate * math.log((7 - rest) / (3 - rest))
means = {setting: mean(*setting) for setting in (("1u", "0"), ("1u", "0", "0.1u"), ("0.1u", "0"), ("1u", "1n"))}
print("mean voltage of the filter, exactly 4.8, for TSTEP, rise time, TMAX")
for setting, value in means.items():
    print(f"  {', '.join(setting):14} {value:.4f}")
settings = [("10u",), ("10u", "", "reltol=1e-4"), ("10u", "", "reltol=1e-6"), ("10u", "1u"), ("10u", "0.1u")]
apart = {setting: period(*setting) / exact - 1 for setting in settings}
print(f"period of the oscillator, exactly {exact:.9g} s, for TSTEP, TMAX, options")
for setting, value in apart.items():
    print(f"  {', '.join(part for part in setting if part):18} {value:+.4%}")
of = list(apart.values())
seen = {
    "a rise time of 0 adds TSTEP to the time on": all(
        abs(value - 12 * (8 + on) / 20) < 0.002 for value, on in zip(means.values(), (1, 1, 0.1, 0.001))
    ),
    "at TSTEP = 10us the oscillator is more than 1 % too fast": of[0] < -0.01,
    "with RELTOL = 1e-6 it is still wrong by more than 1e-4": abs(of[2]) > 1e-4,
    "with TMAX = 0.1us it is right to 1e-5": abs(of[4]) < 1e-5,
}
for sentence, holds in seen.items():
    print("yes" if holds else "NO ", sentence)
sys.exit(not all(seen.values()))
PYTHON
python3 run.py
