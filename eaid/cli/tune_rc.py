"""`eaid tune-rc`."""


def command() -> None:
    """Not built yet."""
