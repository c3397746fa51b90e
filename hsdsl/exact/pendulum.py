"""A pendulum whose string is caught by a pin (ARGESIM comparison C7), by Taylor series."""

from __future__ import annotations

from collections.abc import Mapping

from hsdsl.exact.by_series import by_series
from hsdsl.exact.numbers import Number, mp
from hsdsl.exact.pieces import Lowered
from hsdsl.exact.series import Flow, Series, States, sin_cos
from hsdsl.exact.taylor import Edge, Mode
from hsdsl.execution import Execution

SHORT = mp.mpf("0.3")  # the string below the pin; above it its length is 1
PIN = -mp.pi / 12
STATES = ("phi", "w")


def constrained_pendulum(of: Lowered | None = None) -> Execution:
    """The pendulum from rest at pi/6 until t = 10, solved to forty digits or more.

    Parameters
    ----------
    of : Model, optional
        The model it is an execution of: its file and digest are put on it.

    Returns
    -------
    Execution
        In modes ``long`` and ``short`` with states ``phi``, ``w``; ``settings["error"]`` is its error at any time.

    Raises
    ------
    UsageError
        ``of`` has other modes or states.
    """
    caught = Edge("long->short", "short", lambda x: PIN - x["phi"], _scaled(1 / SHORT))
    freed = Edge("short->long", "long", lambda x: x["phi"] - PIN, _scaled(SHORT))
    modes = {"long": Mode(STATES, _flow(mp.one), (caught,)), "short": Mode(STATES, _flow(SHORT), (freed,))}
    name, title = "constrained-pendulum", "Pendulum whose string is caught by a pin"
    return by_series(name, title, modes, "long", (mp.pi / 6, 0), 10, "0.05", of)


def _flow(length: Number) -> Flow:
    def flow(x: States) -> Mapping[str, Series]:
        sine, _ = sin_cos(x["phi"])
        return {"phi": x["w"], "w": sine * (mp.mpf("-9.81") / length) - x["w"] * (mp.mpf("0.2") / mp.mpf("1.02"))}

    return flow


def _scaled(factor: Number) -> Flow:
    return lambda x: {"w": x["w"] * factor}
