"""Option values that are written as text: numbers, pairs, lists, or a word in place of a number."""

from collections.abc import Callable, Mapping
from typing import get_type_hints

from eaid.errors import UsageError, unknown


def as_typed(_option: str, text: str) -> str:
    """Any text."""
    return text


def number(option: str, text: str) -> float:
    """A number; UsageError where the text is none."""
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{option} {text}: is no number") from None


def pair(example: str) -> Callable[[str, str], tuple[float, float]]:
    """Reads two numbers, with what stands between them in the example."""
    between = ":" if ":" in example else ","

    def read(option: str, text: str) -> tuple[float, float]:
        parts = text.split(between)
        if len(parts) != 2:
            raise UsageError(f"{option} {text}: write two numbers with a {_NAME[between]} between them, as {example}")
        return number(option, parts[0]), number(option, parts[1])

    return read


_NAME = {":": "colon", ",": "comma"}


def numbers(option: str, text: str) -> tuple[float, ...]:
    """Numbers with commas between them."""
    try:
        return tuple(float(part) for part in names(option, text))
    except ValueError:
        raise UsageError(f"{option} {text}: write numbers with commas between them, as 40,70") from None


def spaced(option: str, text: str) -> tuple[float, ...]:
    """`30,40,90`, or `from:to:step` with both ends."""
    try:
        if ":" not in text:
            return tuple(float(part) for part in text.split(","))
        start, end, step = (float(part) for part in text.split(":"))
        count = round((end - start) / step)
    except (ValueError, ZeroDivisionError, OverflowError):
        raise UsageError(f"{option} {text}: give levels as 30,40,90 or as from:to:step") from None
    if not 0 <= count <= 10_000 or abs(start + count * step - end) > 1e-9 * abs(step):
        raise UsageError(f"{option} {text}: the step does not lead from {start:g} to {end:g}")
    return tuple(start + k * step for k in range(count + 1))


def names(option: str, text: str) -> tuple[str, ...]:
    """Names with commas between them."""
    found = tuple(name.strip() for name in text.split(",") if name.strip())
    if not found:
        raise UsageError(f"{option} {text!r}: names nothing; leave it out, or give names with commas between them")
    return found


def word_or_number(*words: str) -> Callable[[str, str], float]:
    """Reads a number where none of some words stands."""

    def read(option: str, text: str) -> float:
        try:
            return float(text)
        except ValueError:
            raise UsageError(f"{option} {text}: must be {', '.join(words)} or a number") from None

    return read


def factors(option: str, text: str) -> dict[str, float]:
    """`Ts=0.9,tau1=1.2`, or widths in percent: names with numbers."""
    found: dict[str, float] = {}
    for part in names(option, text):
        name, _, value = (piece.strip() for piece in part.partition("="))
        if name in found:
            raise UsageError(f"{option} {text}: says {name} twice; give each name once")
        try:
            found[name] = float(value.removesuffix("%"))
        except ValueError:
            raise UsageError(f"{option} {text}: {part!r} is no name=number; write it as Ts=0.9,tau1=1.2") from None
    return found


def keyed(
    option: str, text: str | None, kind: type, names: Mapping[str, str] | None = None
) -> dict[str, float | int | tuple[float, float]]:
    """`duration_s=240,hold_s=0.5:20` as fields of an options type, each read as its type says.

    `names` are those that are typed, with the fields they stand for; by itself the fields' own.
    """
    from eaid.reading import pairs

    types = {name: str(hint) for name, hint in get_type_hints(kind).items() if hint is not str}
    known = names or {name: name for name in types}
    values: dict[str, float | int | tuple[float, float]] = {}
    for name, value in pairs(option, text).items():
        if name not in known:
            raise UsageError(unknown(option, name, sorted(known)))
        said, hint = f"{option} {name}", types[known[name]]
        if "tuple" in hint:
            values[known[name]] = pair("0.3:30")(said, value)
            continue
        read = number(said, value)
        if "int" in hint and not read.is_integer():
            raise UsageError(f"{said}={value}: give a whole number")
        values[known[name]] = int(read) if "int" in hint else read
    return values
