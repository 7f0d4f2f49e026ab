"""How long work is told of: the one callback of the library; the command line draws bars with it."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

# progress(what, how many) → a context that gives a function to call once a piece is done
Progress = Callable[[str, int], AbstractContextManager[Callable[[], None]]]


def no_progress(_what: str, _count: int) -> AbstractContextManager[Callable[[], None]]:
    """Nothing is told."""
    return nullcontext(lambda: None)
