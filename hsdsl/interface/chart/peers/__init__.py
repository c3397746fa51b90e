"""Other tools, each run in the way its own documentation shows. A peer is a function ``prepare(scene)``.

``prepare`` translates the scene once and returns ``run(tolerance) -> Result``; it raises `Refused` where the tool
cannot run the model. Wrong results of an installed tool are charted as wrong.
"""

from __future__ import annotations

from collections.abc import Callable

from hsdsl.base.plugins import Table, function_expected
from hsdsl.interface.chart.scene import Refused, Result, Scene

_MODULES = {
    "scipy": "scipy_ivp",
    "heyoka": "heyoka_taylor",
    "sksundae": "sksundae_cvode",
    "casadi": "casadi_rosenbrock",
    "diffrax": "diffrax_event",
}
Prepare = Callable[[Scene], Callable[[float], Result]]
PEERS = Table[Prepare](
    "peers",
    {name: f"hsdsl.interface.chart.peers.{module}:prepare" for name, module in _MODULES.items()},
    function_expected("a function prepare(scene)"),
)
"""By name, the function that prepares it; other packages may add peers."""


def prepare(name: str, scene: Scene) -> Callable[[float], Result]:
    """Translate a scene for a peer.

    Raises Refused: the peer is not installed, or cannot run this model.
    """
    try:
        peer = PEERS[name]
    except ImportError as error:
        raise Refused(f"not installed ({error.name}); pip install 'hsdsl[peers]'") from None
    run = peer(scene)
    import numpy as np

    def guarded(tolerance: float) -> Result:
        try:
            return run(tolerance)
        except Exception as error:  # a tool's own errors have no common type
            first = str(error).strip().splitlines()[-1:] or [type(error).__name__]
            nothing = np.full((len(scene.grid), len(scene.states)), np.nan)
            return Result(nothing, lambda: np.full(len(scene.grid), "", dtype=object), lambda: None, first[0][:200])

    return guarded
