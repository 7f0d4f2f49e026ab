"""`eaid demo`."""


def command() -> None:
    """Not built yet."""
