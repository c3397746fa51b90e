"""``python -m hsdsl``."""

from hsdsl.interface.cli import main

main()
