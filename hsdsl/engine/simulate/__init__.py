"""From a program to an execution. `located` is the default scheme; `plan` has all.

======================  ==========================================================================================
`settings`, `problem`   the settings of a run; an initial value problem with them
`plan`                  a problem ready to run; the two engines
`run`                   a problem under way, and the state of its mode
`located`               the loop: step, first crossing, reset (Fig. 8 of the paper)
`located_steps`         its steps, with the polynomials of surfaces
`crossings`             the first crossing of each surface of such a step
`relaxed`               the other loop: step, strip, reset (Fig. 12, the paper's algorithm)
`surfaces`              a mode's surfaces at a point, as polynomials along a step, and where these rise through zero
`transitions`           which crossing goes, its reset, the mode entered, cascades, executions that wait
`contact`               guards that hold the state, and motion along them (M11)
`zeno`                  Zeno tails: their limit replaces them, or a run stops there
`control`               the step size, what errors are compared with, why a step fails
`stalls`                when no shorter step helps, and why a run cannot go on, also the compiled one
`stops`                 how runs end and what they remark, in sentences
`input_segments`        inputs as segments that no step crosses
`switches`              when floor, sign, abs, min and max of time change, proved where they do not
`moving`                the finer run that errors are measured by, and how round-off moves it
`paoli_schatzman`       the rival: a two-step formula for one mass and one stop
`recorder`, `review`    rows, arcs and transitions; when the method of a run under way is judged again
`result`                what was recorded or written, as an execution
`compiled`              the same loop in C
`workspace`             where the C loop works; `output_buffers` and `columns` hold its output
`ensemble`              many instances by the compiled loop
`verdict`               do the theorem's hypotheses hold for a run?
======================  ==========================================================================================

A reader of the located scheme opens `located`, and then what a question is about: `crossings` and the roots that they
ask `surfaces` for, `transitions`, or `contact` and `zeno`.
"""

from __future__ import annotations

from hsdsl.engine.simulate.plan import Prepared, prepare
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.settings import Settings

__all__ = ["Prepared", "Problem", "Settings", "prepare"]
