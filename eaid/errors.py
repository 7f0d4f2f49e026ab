"""What eaid refuses, and the exit code that says so (0 is done, 1 a bug, 130 interrupted)."""


class EaidError(Exception):
    """One or more plain sentences: what, where, and what to do. Shown to the user without a traceback."""

    exit_code = 1

    def __init__(self, *sentences: str) -> None:
        super().__init__("\n".join(sentences))
        self.sentences = sentences


class UsageError(EaidError):
    """The command was called wrongly, or would overwrite a file without `--force`."""

    exit_code = 2


class DataError(EaidError):
    """The input data cannot be used; one sentence per fault, all faults of a call at once."""

    exit_code = 3


class GainsError(EaidError):
    """The gains are refused: not physical, out of reach, or unstable on the model."""

    exit_code = 5
