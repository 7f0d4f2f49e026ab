"""`eaid plan`."""


def command() -> None:
    """Not built yet."""
