"""`python -m eaid`, and the `eaid` script: Ctrl-C is answered from the first moment on, before anything is imported."""

import os
import signal
import sys


def _leave(*_signal: object) -> None:
    os.write(2, b"error: interrupted; nothing half-written is left\n")
    os._exit(130)


def main() -> None:
    """Entry point of the `eaid` script."""
    signal.signal(signal.SIGINT, _leave)
    from eaid.cli.main import run

    code = run()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is done is done, and what is told is told
    # where Ctrl-C broke off a text inside exec(), as dataclasses run them, CPython would end itself with the signal
    # even though it was answered; it forgets that with the next one
    exec("")
    sys.exit(code)


if __name__ == "__main__":
    main()
