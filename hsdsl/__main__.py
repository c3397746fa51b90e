"""``python -m hsdsl``."""

from hsdsl.cli import main

main()
