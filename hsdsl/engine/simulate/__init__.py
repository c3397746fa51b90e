"""From a program to an execution. `relaxed` is the paper's algorithm; `SCHEMES` is what a model may name.

======================  ==========================================================================================
`relaxed`               the loop: step, strip, reset (Fig. 12)
`located`               the other loop: step, crossing, reset (Fig. 8)
`dense_steps`           its steps, with states and surfaces as polynomials along them
`surface_polynomials`   surfaces along a step; `root_isolation` finds where polynomials change sign
`interpolation`         how functions are interpolated, and how finely
`touching`              guards that are only reached, and have no flow beyond
`contact`, `zeno`       rest on a guard, and Zeno tails that end in it (M11)
`entry`, `cascade`      entering a mode, where transitions may fire at once; transitions at one instant
`surfaces`              round-off, depth, and where a step crossed a surface
`control`, `scales`     the step size, and what errors are held against
`stall_detection`       when to stop trying shorter steps; `chatter`: steps to and fro across a jump of the flow
`input_segments`        inputs as segments that no step crosses
`switches`              when floor, sign, abs, min and max of time change; `switch_isolation` proves where they do not
`paoli_schatzman`       the rival: a two-step formula for one mass and one stop
`settings`, `problem`   the settings of a run; an initial value problem with them
`run`                   a problem under way, and the state of its mode
`review`                when the method of a run under way is judged again
`recorder`              rows, arcs and transitions, and the execution's columns
`stops`                 how runs end; `standstill` says why one cannot go on
`diagnostics`           departures from the theorem, and what is undecided
`plan`                  a problem ready to run; the two engines
`refinement`            the settings of the finer run that errors are measured by
`moving`                how round-off moves that run
`result`                what was recorded or written, as an execution
`compiled`, `messages`  the same loop in C: its arguments, and its notes and stops in the same words
`workspace`             where the C loop works; `output_buffers`, `columns` and `state_layouts` hold its output
`ensemble`              many instances by the compiled loop
`verdict`               do the theorem's hypotheses hold for a run?
======================  ==========================================================================================
"""

from __future__ import annotations

from hsdsl.engine.simulate.plan import SCHEMES, Prepared, prepare
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.settings import Settings

__all__ = ["SCHEMES", "Prepared", "Problem", "Settings", "prepare"]
