"""`eaid synth`."""


def command() -> None:
    """Not built yet."""
