"""The command ``ppa``."""

import os
import signal
import sys

from ._ppa import run_program


def main() -> int:
    """Run the command line and return the exit code."""
    # The command handles Ctrl-C itself, as when run outside Python. If the shell ignores SIGINT, it stays ignored.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    return run_program(sys.argv, os.path.realpath(sys.argv[0]))
