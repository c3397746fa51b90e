"""The compiled engine: the hand-written C runtime in ``c/``, and how C becomes something Python can call.

============  ====================================================================================
`compiler`    which C compiler there is; `process` runs it
`library`     C text, or a program, to a loaded library, compiled once and kept
`structures`  the structures of the C headers, and a method's table in them
`kernel`      the runtime, compiled programs, and samples of their runs
============  ====================================================================================
"""
