"""`python -m eaid`, and the `eaid` script: a signal is answered from the first line on, before anything is imported."""

import _signal  # type: ignore[import-not-found]  # signal.py itself takes milliseconds to import
import os
import sys


def _leave(*_signal: object) -> None:
    os.write(2, b"error: interrupted; nothing half-written is left\n")
    os._exit(130)


SIGNALS = tuple(getattr(_signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(_signal, name))
_answered = [number for number in SIGNALS if _signal.getsignal(number) != _signal.SIG_IGN]  # nohup's stays
for _number in _answered:
    _signal.signal(_number, _leave)


def main() -> None:
    """Entry point of the `eaid` script."""
    import gc

    from eaid.cli.main import run

    try:
        code = run()
    except KeyboardInterrupt:  # between two lines of its own
        return _leave()
    for number in _answered:
        _signal.signal(number, _signal.SIG_IGN)  # what is done is done, and what is told is told
    # where Ctrl-C broke off a text inside exec(), as dataclasses run them, CPython would end itself with the signal
    # even though it was answered; it forgets that with the next one
    exec("")
    gc.freeze()  # no last search for garbage through all modules: it would take 30 ms
    sys.exit(code)


if __name__ == "__main__":
    main()
