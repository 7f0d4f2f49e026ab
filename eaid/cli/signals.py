"""Ctrl-C, a polite kill and a terminal that closes break a command off, wherever it is, and are never dropped."""

import _thread
import contextlib
import signal
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

AGAIN_S = 0.02  # After which an interrupt comes again that a destructor or a weak reference's callback swallowed [s]


@contextlib.contextmanager
def breaking_off() -> Iterator[list[float]]:
    """SIGTERM and SIGHUP break off as Ctrl-C does while the block runs; yields when signals came."""
    came: list[float] = []
    timers: list[threading.Timer] = []

    def interrupt(_number: int, _frame: object) -> None:
        came.append(time.monotonic())
        if len(came) == 1 or came[-1] - came[-2] > 1.0:  # a second one at once does not break off the clearing away
            raise KeyboardInterrupt

    def swallowed(fault: Any) -> None:
        """Python drops an exception in a destructor; an interrupt comes again, from outside of it."""
        if not isinstance(fault.exc_value, KeyboardInterrupt):
            sys.__unraisablehook__(fault)
            return
        came.clear()
        timers.append(threading.Timer(AGAIN_S, _thread.interrupt_main))
        timers[-1].start()

    taken = threading.current_thread() is threading.main_thread()  # no other thread may take signals
    numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if taken and hasattr(signal, name)]
    before = {n: held for n in numbers if (held := signal.getsignal(n)) not in (None, signal.SIG_IGN)}
    for number in before:
        signal.signal(number, interrupt)
    unraisable, sys.unraisablehook = sys.unraisablehook, swallowed
    try:
        yield came
    finally:
        for timer in timers:
            timer.cancel()
        sys.unraisablehook = unraisable
        for number, handler in before.items():
            signal.signal(number, handler)
