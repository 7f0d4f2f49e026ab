"""`eaid ingest`."""


def command() -> None:
    """Not built yet."""
