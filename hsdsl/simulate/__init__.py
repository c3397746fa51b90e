"""From a program to an execution. `relaxed` is the paper's algorithm; `SCHEMES` is what a model may name.

==================  ===========================================================================================
`relaxed`           the loop: step, strip, reset (Fig. 12)
`located`           the other loop: step, crossing, reset (Fig. 8)
`spans`             its steps, with states and surfaces as polynomials along them
`along`, `isolate`  surfaces along a step; where polynomials change sign
`interpolation`     how functions are interpolated, and how finely
`rest`, `tails`     rest on a guard, and Zeno tails that end in it (M11)
`entry`             entering a mode: transitions that fire at once
`surfaces`          round-off, depth, and where a step crossed a surface
`control`           the step size
`patience`          when to stop trying shorter steps
`timeline`          inputs as segments no step crosses
`switches`          when floor, sign, abs, min and max of time change; `pieces` proves that they do not elsewhere
`paoli_schatzman`   the rival: a two-step formula for one mass and one stop
`run`               what stays for a whole run, and where it stands
`recorder`          rows, arcs and transitions, and the execution's columns
`stops`, `notes`    how runs end, and what else they say of themselves, in sentences
`prepared`          a run as far as its arguments decide it; the two engines
`result`            what was recorded or written, as an execution
`compiled`          the same loop in C: what it is given
`telling`           what it says of a run, in the same words
`layouts`           which states its arcs have
`workspace`, `chunks`    where the compiled loop works, and what it writes to; `columns` is what it has written
`ensemble`          many instances by the compiled loop
`interrupt`         Ctrl-C while it runs
`verdict`           do the theorem's hypotheses hold for a run?
==================  ===========================================================================================
"""

from __future__ import annotations

from hsdsl.simulate.plan import SCHEMES, Prepared, prepare
from hsdsl.simulate.settings import Settings

__all__ = ["SCHEMES", "Prepared", "Settings", "prepare"]
