"""C99 from a program: `source` writes the whole text, `printer` one routine of it."""

from hsdsl.backends.c.source import model_source

__all__ = ["model_source"]
