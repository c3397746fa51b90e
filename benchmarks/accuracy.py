"""How accurate the relaxed scheme is on the paper's scenes, against closed forms and independent integrations.

Prints one line a scene: settings, transitions, and the largest error. Event times have the strips' delays subtracted
(each relaxed transition resumes `resumed - time` late, and everything after it is late by that).

    python benchmarks/accuracy.py
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

import hsdsl
from hsdsl.model.estimate import corrected_times

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "models")]  # independent integrations and closed forms

from exact.pendulum import exact_pendulum  # noqa: E402
from references.impact_oscillator import exact_example_1, exact_example_2  # noqa: E402

RUNNER = {
    "A": ("0", [0.2435646781063, 0.2435646781063, 0.6755930236353, 0.6755930236353, 0.9259377788821]),
    "B": ("-0.4", [0.2043666230745, 0.2419518050349, 0.6049710813402, 0.6091929509614, 0.6683909550717]),
}


def load(name: str) -> Any:
    """A model of the folder."""
    return hsdsl.load(ROOT / "models" / f"{name}.yaml")


def oscillators() -> None:
    """Largest position error at the samples."""
    scenes = [
        (1, exact_example_1, "1e-3", "2e-8"),
        (1, exact_example_1, "5e-4", "1e-8"),
        (2, exact_example_2, "1e-2", "2e-7"),
    ]
    for number, exact, step, relaxation in scenes:
        run = load(f"oscillator-with-stop-{number}").simulate(method="midpoint", step=step, relaxation=relaxation)
        error = np.max(np.abs(run.values[:, 0] - exact().at(run.times)[0]))
        print(
            f"oscillator {number}, midpoint, h {step}, eps {relaxation}: {len(run.transitions)} transitions, "
            f"position error {error:.2e}, {run.seconds['simulate']:.2f} s"
        )


def runner() -> None:
    """Event times, pitch and energy of the pronking runner."""
    for name, (w, wanted) in RUNNER.items():
        run = load("pronking-runner").simulate(initial={"w": w})
        error = np.max(np.abs(np.array(corrected_times(run.transitions)) - wanted))
        states = [run(t).state for t in np.linspace(0, run.stop.time, 401)]
        energies = [energy(state) for state in states]
        print(
            f"runner {name}, {run.method} at tolerance {run.settings['tolerance']:g}, eps "
            f"{run.settings['relaxation']:g}: {len(run.transitions)} transitions, event times within {error:.2e}, "
            f"energy {energies[0]:.3f} drifts by at most {max(abs(e - energies[0]) for e in energies):.1e}"
        )
    coarse = load("pronking-runner").simulate(relaxation="1e-2")
    pitch = np.max(np.abs(coarse.values[:, coarse.arcs[0].states.index("th")]))
    print(f"runner A at eps 1e-2: |theta| <= {pitch:.1e}, edges {[t.edge for t in coarse.transitions]}")


def energy(state: dict[str, float]) -> float:
    """Kinetic, potential and spring energy at the model's parameters."""
    total = 9.81 * state["z"] + (state["vx"] ** 2 + state["vz"] ** 2 + state["w"] ** 2) / 2
    for side, foot in ((0.5, "pl"), (-0.5, "pr")):
        if foot in state:
            hip = state["x"] + side * np.cos(state["th"]), state["z"] + side * np.sin(state["th"])
            total += 15 * (1 - np.hypot(hip[0] - state[foot], hip[1])) ** 2
    return float(total)


def pendulum() -> None:
    """Switching times of the constrained pendulum."""
    switches, _ = exact_pendulum()
    run = load("constrained-pendulum").simulate()
    error = np.max(np.abs(np.array(corrected_times(run.transitions)) - [float(s.time) for s in switches]))
    print(f"pendulum: {len(run.transitions)} switches, times within {error:.2e}")


def digital_control() -> None:
    """Ends of the digital control system from and beside the diagonal, in units of eps."""
    eps, delta = 1e-6, 0.1
    model = load("digital-control")
    for name, (dx, dy), end in (
        ("x", (0, 0), (1, 1)),
        ("y_d", (delta, 0), (1 - delta, 1 - 0.2 * delta)),
        ("z_d", (0, delta), (1 - 0.3 * delta, 1 - delta)),
    ):
        run = model.simulate(relaxation=eps, initial={"x": -1 - dx, "y": -1 - dy})
        modes = [t.source for t in run.transitions] + [run.final.mode]
        off = [(run.final.state[s] - e) / eps for s, e in zip("xy", end, strict=True)]
        passed_over = [t.alternatives for t in run.transitions if t.alternatives]
        print(
            f"digital control {name}: {'-'.join(modes)}, end off by ({off[0]:.2f}, {off[1]:.2f}) eps, "
            f"passed over {passed_over}"
        )


if __name__ == "__main__":
    oscillators()
    runner()
    pendulum()
    digital_control()
