"""How long work is told of: the one callback of the library; the command line draws bars with it."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

# progress(what, how many) → a context that gives a function to call once a piece is done
Progress = Callable[[str, int], AbstractContextManager[Callable[[], None]]]


class _Silence:
    """Nothing is told; `help` shows its name."""

    def __call__(self, _what: str, _count: int) -> AbstractContextManager[Callable[[], None]]:
        return nullcontext(lambda: None)

    def __repr__(self) -> str:
        return "no_progress"


no_progress: Progress = _Silence()
