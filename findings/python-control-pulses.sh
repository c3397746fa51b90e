#!/usr/bin/env bash
# What input_output_response of python-control 0.10.2 does with a pulse in the array of inputs U, for x' = u - x from 0,
# sampled every 0.01 until 100. Its documentation does not say that samples may be passed over.
#
# - A pulse of 1 from 50 to 53 has no effect at all: x is 0 at every sample, instead of up to 0.950. The solver's steps
#   have grown while nothing happened, and none ends in the pulse. So it is with pulses of 0.1 to 3.
# - forced_response, and max_step = 0.01 in solve_ivp_kwargs, are right up to what the ramp between two samples adds.
#
# Exits with 0 while this is so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check control==0.10.2 scipy==1.17.1 2> /dev/null
"$folder/venv/bin/python" - << 'PYTHON'
import math
import sys

import control
import numpy as np

lag = control.nlsys(lambda t, x, u, parameters: u - x, inputs=1, outputs=1, states=1)
linear = control.ss([[-1]], [[1]], [[1]], [[0]])
times = np.linspace(0, 100, 10001)
lost = found = True
for length in (0.1, 0.5, 1, 3):
    pulse = ((times >= 50) & (times < 50 + length)).astype(float)
    exact = 1 - math.exp(-length)
    responses = (
        control.input_output_response(lag, times, pulse, 0),
        control.input_output_response(lag, times, pulse, 0, solve_ivp_kwargs={"max_step": 0.01}),
        control.forced_response(linear, times, pulse),
    )
    plain, short, of_linear = (float(np.max(response.outputs)) for response in responses)
    print(f"pulse of {length}: exactly {exact:.4f}; {plain:.4f}, with max_step {short:.4f}, forced_response {of_linear:.4f}")
    lost = lost and plain == 0
    found = found and abs(short - exact) < 0.01 and abs(of_linear - exact) < 0.01
for sentence, holds in (("each pulse is lost", lost), ("max_step and forced_response are right to 0.01", found)):
    print("yes" if holds else "NO ", sentence)
sys.exit(not (lost and found))
PYTHON
