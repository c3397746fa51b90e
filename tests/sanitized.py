"""Run every case, every model and some random ones by the compiled loop, in small chunks: to be run under sanitizers.

Started by `unit/test_sanitizers.py`; a fault ends the process with a message of the sanitizer.
"""

from __future__ import annotations

from itertools import product

from conformance.test_agreement import FLOATS, LONG, MODELS, SHORT, STEPS, arguments
from conformance.test_conformance import CASES, Run, model, read
from property.random_models import SETTINGS, random_model

import hsdsl
from hsdsl.elaborate import elaborate
from hsdsl.errors import ModelError, UsageError
from hsdsl.integrators import INTEGRATORS
from hsdsl.model import Model
from hsdsl.simulate import chunks
from hsdsl.simulate.compiled import SCHEMES


def main() -> None:
    chunks.LEAST_ROWS, chunks.MOST_ROWS = 12, 200
    count = 0
    for name in CASES:
        for run in map(Run.of, read(CASES[name])["runs"]) if name not in LONG else ():
            for setting, scheme in product(list(FLOATS.values())[::3], SCHEMES):
                count += model(name).simulate(**arguments(run, setting, scheme), engine="c").engine == "c"
    for name, path in MODELS.items():
        loaded = hsdsl.load(path)
        for method in INTEGRATORS:
            for setting, scheme in product(({**s, **SHORT.get(name, {})} for s in STEPS), SCHEMES):
                run = loaded.simulate(method=method, max_transitions=40, scheme=scheme, **setting, engine="c")
                count += run.engine == "c"
    for seed in range(25):
        try:
            drawn = Model(elaborate("random.yaml", text=random_model(seed).encode()))
            for setting, scheme in product(SETTINGS, SCHEMES):
                count += drawn.simulate(max_transitions=25, scheme=scheme, **setting, engine="c").engine == "c"
        except (ModelError, UsageError):
            continue
    print(f"{count} runs")


if __name__ == "__main__":
    main()
