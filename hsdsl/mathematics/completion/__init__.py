"""Completions of a system: flows for states that its own flows and resets hold on a guard.

`contact` is motion along the guard of an edge that leads back to its own mode, the limit of ever faster transitions;
`nearby` has what it depends on. `constrained_mode` has the motions of all edges of a mode, also along several guards.
`sliding` is motion on a surface that two modes press on. `text` writes these into a model file.
"""

from __future__ import annotations

from hsdsl.mathematics.completion.constrained import ConstrainedMode, constrained_modes
from hsdsl.mathematics.completion.contact import Contact, contact
from hsdsl.mathematics.completion.sliding import Sliding, slidings, with_sliding

__all__ = ["ConstrainedMode", "Contact", "Sliding", "constrained_modes", "contact", "slidings", "with_sliding"]
