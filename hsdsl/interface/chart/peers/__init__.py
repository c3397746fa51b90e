"""Other tools, each run in the way its own documentation shows. A peer is a module with ``prepare(scene)``.

``prepare`` translates the scene once and returns ``run(tolerance) -> Result``; it raises `Refused` where the tool
cannot run the model. Wrong results of an installed tool are charted as wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from hsdsl.interface.chart.scene import Refused, Result, Scene

PEERS = {
    "scipy": "scipy_ivp",
    "heyoka": "heyoka_taylor",
    "sksundae": "sksundae_cvode",
    "casadi": "casadi_rosenbrock",
    "diffrax": "diffrax_event",
}
"""By name, the module here that runs it."""


def prepare(name: str, scene: Scene) -> Callable[[float], Result]:
    """Translate a scene for a peer.

    Raises Refused: the peer is not installed, or cannot run this model.
    """
    try:
        peer = import_module(f"hsdsl.interface.chart.peers.{PEERS[name]}")
    except ImportError as error:
        raise Refused(f"not installed ({error.name}); pip install 'hsdsl[peers]'") from None
    return _guarded(peer.prepare(scene), scene)


def _guarded(run: Callable[[float], Result], scene: Scene) -> Callable[[float], Result]:
    """Turn an exception of a tool into a failed result, which the chart shows."""
    import numpy as np

    def guarded(tolerance: float) -> Result:
        try:
            return run(tolerance)
        except Exception as error:  # a tool's own errors have no common type
            first = str(error).strip().splitlines()[-1:] or [type(error).__name__]
            nothing = np.full((len(scene.grid), len(scene.states)), np.nan)
            return Result(nothing, lambda: np.full(len(scene.grid), "", dtype=object), lambda: None, first[0][:200])

    return guarded
