"""Output to readers of all kinds: one that goes away (`eaid … | head`), none at all, one that knows few letters."""

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from typing import Any

from eaid.errors import UsageError


class Patient:
    """A text stream that goes on as if nothing had happened once its pipe is closed at the other end."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write, or drop what nobody reads."""
        with self._read_or_not():
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Flush, or drop what nobody reads."""
        with self._read_or_not():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    @contextlib.contextmanager
    def _read_or_not(self) -> Iterator[None]:
        try:
            yield
        except OSError as fault:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)
            if not isinstance(fault, BrokenPipeError):  # a full disk behind `>`
                said = f"what is printed cannot be written ({fault.strerror}); make room, or send it elsewhere"
                raise UsageError(said) from None


@contextlib.contextmanager
def patient_streams() -> Iterator[None]:
    """Stdout and stderr that outlive their readers while the block runs; both are flushed at its end.

    A closed one is replaced by one that drops all; letters that the reader's encoding has not become `?`.
    """
    before = sys.stdout, sys.stderr
    for stream in before:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    sys.stdout, sys.stderr = (Patient(stream) if stream is not None else io.StringIO() for stream in before)
    try:
        yield
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
    finally:
        sys.stdout, sys.stderr = before
