"""The command line: a module for each command, without numerics.

Exit codes: 0 done, 1 the model has errors, 2 wrong usage or an unreadable file, 3 the run stopped before its end, 130
interrupted. Messages and progress go to standard error; with ``--json`` standard output is one JSON object.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys

from hsdsl.base import interrupts


def main() -> None:
    """Run the command line (the ``hsdsl`` script)."""
    interrupts.expect()  # before anything that takes long to import
    from hsdsl.engine import ahead
    from hsdsl.interface.cli.console import WRONG_USAGE, prepare

    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # NumPy's other threads would only wait, and take time for it
    gc.set_threshold(100_000)  # collections during imports take a tenth of a short run
    atexit.register(gc.freeze)  # the collection at the end of the process takes a sixth of one
    prepare()
    code = 0
    try:
        ahead.begin_run(sys.argv[1:])
        from hsdsl.interface.cli.verbs import obey

        code = obey(sys.argv[1:])
        sys.stdout.flush()  # a full disk shows here rather than when the interpreter ends
    except BrokenPipeError:
        _drop_output()  # nobody reads: nothing left to say
    except OSError as error:
        code = WRONG_USAGE
        _drop_output()
        print(f"hsdsl: cannot write the output: {error.strerror or error}", file=sys.stderr)
    except MemoryError:
        code = WRONG_USAGE
        print("hsdsl: not enough memory for this request", file=sys.stderr)
    except KeyboardInterrupt:
        code = interrupts.INTERRUPTED
    sys.exit(code)


def _drop_output() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.__stdout__.fileno() if sys.__stdout__ else 1)
