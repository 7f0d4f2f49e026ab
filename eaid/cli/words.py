"""Option values that are written as text: numbers, pairs, lists, or a word."""

from eaid.errors import UsageError


def number(option: str, text: str) -> float:
    """A number; UsageError where the text is none."""
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{option} {text}: is no number") from None


def pair(option: str, text: str | None, example: str) -> tuple[float, float] | None:
    """Two numbers with a comma between them."""
    if text is None:
        return None
    numbers = [number(option, part) for part in text.split(",")]
    if len(numbers) != 2:
        raise UsageError(f"{option} {text}: write two numbers with a comma between them, as {example}")
    return numbers[0], numbers[1]


def names(text: str | None) -> tuple[str, ...]:
    """Names with commas between them."""
    return tuple(name.strip() for name in (text or "").split(",") if name.strip())


def word_or_number(text: str | None, words: tuple[str, ...], option: str) -> str | float | None:
    """One of some words, or a number."""
    if text is None or text in words:
        return text
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{option} {text}: must be {', '.join(words)} or a number") from None


def numbers(option: str, text: str | None) -> tuple[float, ...]:
    """Numbers with commas between them."""
    return tuple(number(option, part) for part in names(text))
