"""`eaid simulate`."""


def command() -> None:
    """Not built yet."""
