"""Build the stored references: ``python models/references/build.py [NAME-BLOCK]...``, all of them when none is named.

Scenes of the gallery go to ``models/gallery/references`` as ``gallery/NAME``; some are executions that slide along a
surface, and solve the completed model.

Each is solved in eighty digits from equations written by hand: by formula, or by Taylor series of order 40 with steps
and half steps (`references.by_series`). A solution by series is written only if the relaxed scheme, refined by
`hsdsl.exact.precise` from the model's file, agrees to nine digits.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

MODELS = Path(__file__).parents[1]
if __name__ == "__main__":
    sys.path.insert(0, str(MODELS))

import hsdsl  # noqa: E402
from hsdsl.analysis.exact.references import STORED, references_of  # noqa: E402
from hsdsl.analysis.exact.refined import difference  # noqa: E402
from hsdsl.engine.execution import Execution  # noqa: E402
from references.bouncing_ball import bouncing_ball  # noqa: E402
from references.constrained_pendulum import constrained_pendulum  # noqa: E402
from references.digital_control import digital_control  # noqa: E402
from references.gallery import GALLERY  # noqa: E402
from references.oscillators import oscillator  # noqa: E402
from references.pronking_runner import pronking_runner  # noqa: E402
from references.stiff_switch import stiff_switch  # noqa: E402
from references.thermostat import thermostat  # noqa: E402

DIGITS = 9  # that a solution by series and the relaxed scheme must agree to
REFERENCES: dict[str, tuple[Callable[[], Execution], ...]] = {
    "bouncing-ball": (bouncing_ball,),
    "constrained-pendulum": (constrained_pendulum,),
    "digital-control": (digital_control, lambda: digital_control("-1.1", -1), lambda: digital_control(-1, "-1.1")),
    "oscillator-with-stop-1": (lambda: oscillator(1),),
    "oscillator-with-stop-2": (lambda: oscillator(2),),
    "pronking-runner": (pronking_runner, lambda: pronking_runner("-0.4")),
    "stiff-switch": (stiff_switch,),
    "thermostat": (thermostat,),
}
"""By the name of a model, one for each block of its ``reference:`` section."""


def solved(name: str, block: int) -> Execution:
    """Solve a reference; compare a solution by series with the relaxed scheme."""
    run = REFERENCES[name][block]()
    if run.method == "closed form":
        return run
    model = hsdsl.load(MODELS / f"{name}.yaml")
    initial = {key.removeprefix("initial."): text for key, text in references_of(model)[block].items()}
    apart = difference(run, hsdsl.exact.precise(model, DIGITS + 2, initial=initial))
    if not apart <= 10.0**-DIGITS:
        raise SystemExit(f"{name}, block {block}: the relaxed scheme's refined run is {apart:.2g} away")
    agreed = f"; the relaxed scheme, refined from the model's file, agrees to {apart:.1g}"
    return replace(run, settings=run.settings | {"source": run.settings["source"] + agreed})


def main(names: list[str]) -> None:
    """Write the named references, or all."""
    for name, solutions in REFERENCES.items():
        for block in range(len(solutions)):
            stem = f"{name}-{block}"
            if not names or stem in names:
                run = solved(name, block)
                run.save(STORED / f"{stem}.npz")
                _report(f"{stem}.npz", run)
    for name, solve in GALLERY.items():
        if not names or f"gallery/{name}" in names:
            run = solve()
            run.save(MODELS / "gallery" / "references" / f"{name}.npz")
            _report(f"gallery/{name}.npz", run)


def _report(file: str, run: Execution) -> None:
    print(f"{file}: error {run.settings['error']:.2g}, {run.settings['source']}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
