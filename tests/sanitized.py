"""Run cases, every model and some random ones by the compiled loop, in small chunks: to be run under sanitizers.

With the argument `all` every case and more of all others.

Started by `unit/test_sanitizers.py`; a fault ends the process with a message of the sanitizer.
"""

from __future__ import annotations

import sys
import tempfile
from itertools import product
from pathlib import Path
from typing import Any

from conformance.test_agreement import COMPILED, LONG, MODELS, SHORT, STEPS, calls
from conformance.test_conformance import CASES, model
from property.random_models import SETTINGS, SMOOTH_SETTINGS, random_model, smooth_model

import hsdsl
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.engine.integrators import FALLBACK
from hsdsl.engine.runtime.structures import COMPILED_SCHEMES
from hsdsl.engine.simulate import output_buffers
from hsdsl.interface.model import Model
from hsdsl.language.elaborate import elaborate

ALL = sys.argv[1:] == ["all"]
SOME = list(CASES) if ALL else list(CASES)[::3]
WITH = STEPS if ALL else STEPS[:1]


def by_c(model: Model, **arguments: Any) -> bool:
    """Run, and look at what was run at times in and between rows, in no order."""
    run = model.simulate(**arguments, engine="c")
    for side in ("right", "left"):
        run.sample([*run.times[::7], *(0.5 * (run.times[1:] + run.times[:-1]))[::-3]], side)
    return run.engine == "c"


def in_other_ways(model: Model, folder: Path, **arguments: Any) -> int:
    """In one chunk, as an ensemble, and streamed."""
    count = by_c(model, **arguments)
    arguments["max_transitions"] = 40
    many = model.ensemble(samples=50, transition_times=3, **arguments)
    streamed = model.stream(folder / "rows.csv", every=3, **arguments)
    return count + many.stop.size + (streamed.rows > 0)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        count = sum(
            in_other_ways(
                hsdsl.load(path), Path(folder), method=method, scheme=scheme, **({**step, **SHORT.get(name, {})})
            )
            for name, path in MODELS.items()
            for step, (scheme, method) in product(WITH, COMPILED)
        )
    print(f"{count + in_chunks()} runs")


def in_chunks() -> int:
    """In chunks so small that every run fills several."""
    output_buffers.LEAST_ROWS, output_buffers.MOST_ROWS = 12, 200
    count = 0
    for name, scheme in product(SOME, COMPILED_SCHEMES):
        for call in calls(name, scheme)[::3] if name not in LONG else ():
            if (scheme, call.get("method", FALLBACK)) in COMPILED:
                count += by_c(model(name), **{key: value for key, value in call.items() if key != "verdict"})
    for name, path in MODELS.items():
        loaded = hsdsl.load(path)
        for setting, (scheme, method) in product(({**s, **SHORT.get(name, {})} for s in WITH), COMPILED):
            count += by_c(loaded, method=method, max_transitions=40, scheme=scheme, **setting)
    for seed in range(25 if ALL else 8):
        for text, settings in ((random_model(seed), SETTINGS), (smooth_model(seed), SMOOTH_SETTINGS)):
            try:
                drawn = Model(elaborate("random.yaml", text=text.encode()))
                for setting, scheme in product(settings, COMPILED_SCHEMES):
                    if (scheme, setting.get("method", FALLBACK)) in COMPILED:
                        count += by_c(drawn, max_transitions=25, scheme=scheme, **setting)
            except (ModelError, UsageError):
                continue
    return count


if __name__ == "__main__":
    main()
