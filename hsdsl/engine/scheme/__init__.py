"""Parts of the algorithm, written once: text in a subset of Python, which Python runs and C is printed from.

In: numbers, vectors and records of what a run knows. Out: what Python computes from them, and the files of C of the
same name (`printer.printed`). The page `docs/scheme.md` defines the subset. Read ``roots``, then ``printer``.
"""
