"""Completions of a system: flows for states that its own flows and resets hold on a guard.

`contact` is motion along the guard of an edge that leads back to its own mode, the limit of ever faster transitions;
`nearby` has what it depends on. `overlay` has the motions of all edges of a mode in one, also along several guards.
`sliding` is motion on a surface that two modes press on. `text` writes these into a model file.
"""

from __future__ import annotations

from hsdsl.mathematics.completion.contact import Contact, contact
from hsdsl.mathematics.completion.overlay import Overlay, overlays
from hsdsl.mathematics.completion.sliding import Sliding, slidings, with_sliding

__all__ = ["Contact", "Overlay", "Sliding", "contact", "overlays", "slidings", "with_sliding"]
