"""How far apart are two states, or two executions? Distances that do not blow up at a jump.

The paper's metric (Burden et al. 2013, Sec. II and III) is the length of the shortest connected curve: straight pieces
inside domains, free passage between a guard point and its reset image, in either direction.
"""

from hsdsl.analysis.metrics.interval import INFINITE, ZERO, Interval

__all__ = ["INFINITE", "ZERO", "Interval"]
