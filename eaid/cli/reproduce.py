"""`eaid reproduce`."""


def command() -> None:
    """Not built yet."""
