"""`python -m misfit`, and the script `misfit` of the package: the command line."""

import signal
import sys

from . import _native


def main() -> None:
    """Runs the words of the command line and exits as the program does."""
    # The program watches Ctrl-C itself; Python's own handler would raise an error after it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_native.main(sys.argv[1:]))


if __name__ == "__main__":
    main()
