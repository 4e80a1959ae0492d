"""The command ``ppa``."""

import os
import signal
import sys

from ._ppa import run_program


def main() -> int:
    """Run the command line and return the exit code."""
    # As in a program of its own: the command decides what Ctrl-C does. Where the shell ignores it, that stays.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    return run_program(sys.argv, os.path.realpath(sys.argv[0]))
