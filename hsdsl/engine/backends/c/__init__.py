"""C99 from a program: `source` writes the whole text, `routine` one routine of it, `series` its Taylor coefficients."""
