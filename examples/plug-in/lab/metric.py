"""A distance of runs: the largest difference of the states at their ends."""

from math import inf

from hsdsl import Execution


def ends(a: Execution, b: Execution) -> float:
    """Compare the last states; runs that end in different modes are infinitely far apart."""
    if a.final.mode != b.final.mode:
        return inf
    return max(abs(float(a.final[name]) - float(b.final[name])) for name in a.final.state)
