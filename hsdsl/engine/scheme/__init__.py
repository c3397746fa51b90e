"""The algorithm, once: text in a subset of Python, which Python runs as it is and from which C is printed.

In: numbers, vectors and records of what a run knows. Out: what Python computes from them, and the files of C of the
same name (`printer.printed`). The page `docs/scheme.md` defines the subset. Read ``roots``, then ``printer``.
"""
