"""`eaid fit`."""


def command() -> None:
    """Not built yet."""
