"""`eaid report`."""


def command() -> None:
    """Not built yet."""
