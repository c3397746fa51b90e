"""The compiled engine: the hand-written C runtime in ``c/``, and how C becomes something Python can call.

============  ====================================================================================
`compiler`    which C compiler there is
`library`     C text to a loaded library, compiled once and kept
`programs`    that of a program
`kernel`      a program's routines, compiled, as a `Kernel` like any other
============  ====================================================================================
"""
