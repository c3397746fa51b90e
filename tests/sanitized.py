"""Run every case, every model and some random ones by the compiled loop, in small chunks: to be run under sanitizers.

Started by `unit/test_sanitizers.py`; a fault ends the process with a message of the sanitizer.
"""

from __future__ import annotations

from itertools import product

from conformance.test_agreement import COMPILED, FLOATS, LONG, MODELS, SHORT, STEPS, arguments
from conformance.test_conformance import CASES, Run, model, read
from property.random_models import SETTINGS, SMOOTH_SETTINGS, random_model, smooth_model

import hsdsl
from hsdsl.elaborate import elaborate
from hsdsl.errors import ModelError, UsageError
from hsdsl.integrators import AUTO
from hsdsl.model import Model
from hsdsl.simulate import chunks
from hsdsl.simulate.compiled import SCHEMES


def main() -> None:
    chunks.LEAST_ROWS, chunks.MOST_ROWS = 12, 200
    count = 0
    for name in CASES:
        for run in map(Run.of, read(CASES[name])["runs"]) if name not in LONG else ():
            for setting, (scheme, method) in product(list(FLOATS.values())[::3], COMPILED):
                if setting.get("method", AUTO) == method:
                    count += model(name).simulate(**arguments(run, setting, scheme), engine="c").engine == "c"
    for name, path in MODELS.items():
        loaded = hsdsl.load(path)
        for setting, (scheme, method) in product(({**s, **SHORT.get(name, {})} for s in STEPS), COMPILED):
            run = loaded.simulate(method=method, max_transitions=40, scheme=scheme, **setting, engine="c")
            count += run.engine == "c"
    for seed in range(25):
        for text, settings in ((random_model(seed), SETTINGS), (smooth_model(seed), SMOOTH_SETTINGS)):
            try:
                drawn = Model(elaborate("random.yaml", text=text.encode()))
                for setting, scheme in product(settings, SCHEMES):
                    if (scheme, setting.get("method", AUTO)) in COMPILED:
                        count += drawn.simulate(max_transitions=25, scheme=scheme, **setting, engine="c").engine == "c"
            except (ModelError, UsageError):
                continue
    print(f"{count} runs")


if __name__ == "__main__":
    main()
