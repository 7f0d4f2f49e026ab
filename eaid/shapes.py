"""What a result file may hold: shapes, and the one walk that holds a file against them.

A value of another shape than its key's is refused. `null` stands for what is not known and passes, where the shape does
not need it. A part that lacks what it needs is left out, and told: it costs the feature that needs it, and nothing
else. Keys that no shape names are passed over.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

HIGHEST = 1e60
"""Size above which no number of a result is believed: its cube is still a number."""


@dataclass(frozen=True)
class Number:
    """A number."""

    known: bool = False
    """Whether null is refused."""
    least: float = -HIGHEST
    above: bool = False
    """Whether `least` itself is refused."""
    most: float = HIGHEST
    whole: bool = False

    @property
    def words(self) -> str:
        """What is wanted, for a sentence."""
        if self.whole:
            return f"a whole number from {self.least:g} on"
        if self.least > -HIGHEST:
            upper = f" and at most {self.most:g}" if self.most < HIGHEST else ""
            return f"a number {'above' if self.above else 'from'} {self.least:g}{'' if self.above else ' on'}{upper}"
        return "a number"

    def holds(self, value: Any) -> bool:
        """Whether a value is such a number."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            return False
        inside = self.least <= value <= self.most and not (self.above and value == self.least)
        return inside and (not self.whole or value == int(value))


@dataclass(frozen=True)
class Word:
    """A text, or one of a few."""

    of: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """What is wanted, for a sentence."""
        return f"one of {', '.join(self.of)}" if self.of else "a text"

    def holds(self, value: Any) -> bool:
        """Whether a value is such a text."""
        return isinstance(value, str) and (not self.of or value in self.of)


@dataclass(frozen=True)
class Flag:
    """True or false."""

    words = "true or false"

    def holds(self, value: Any) -> bool:
        """Whether a value is one of the two."""
        return isinstance(value, bool)


@dataclass(frozen=True)
class Many:
    """A list."""

    of: "Shape"
    count: int | None = None
    """How many; None: any number."""
    known: bool = False
    """Whether null is refused."""

    @property
    def words(self) -> str:
        """What is wanted, for a sentence."""
        if self.count is None:
            return "a list"
        return f"a list of {self.count} numbers" if isinstance(self.of, Number) else f"a list of {self.count}"

    def holds(self, value: Any) -> bool:
        """Whether a value is such a list, whatever is in it."""
        return isinstance(value, list) and self.count in (None, len(value))


@dataclass(frozen=True)
class Part:
    """An object with keys of its own shapes."""

    keys: Mapping[str, "Shape"] = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    """Keys without which the part is left out."""
    rest: "Shape | None" = None
    """What all other keys hold; None: anything."""
    doubt: Callable[[Mapping[str, Any]], str | None] = lambda _: None
    """What is wrong with the part as a whole, behind "its PART"; None where nothing is."""
    words = "an object"

    def holds(self, value: Any) -> bool:
        """Whether a value is an object, whatever is in it."""
        return isinstance(value, dict)


Shape = Number | Word | Flag | Many | Part


class Misshapen(Exception):  # noqa: N818  it is told as a DataError, by who knows the file
    """A value is not what its key promises; the text says which and what it is."""


def shaped(value: Any, shape: Shape, name: str, left_out: list[str]) -> Any:
    """A value held against its shape: without the parts that lack what they need, which `left_out` is told.

    `name` is how sentences call it. Raises Misshapen at the first value of another shape.
    """
    if value is None and not getattr(shape, "known", False):
        return None
    if isinstance(shape, Part) and value in ([], ""):
        return None  # empty is as good as absent
    if not shape.holds(value):
        raise Misshapen(f"its {name} is {short(value)}, not {shape.words}")
    if isinstance(shape, Many):
        return _list(value, shape, name, left_out)
    if isinstance(shape, Part):
        return _object(value, shape, name, left_out)
    return value


_LACKS = object()


def _list(value: list[Any], shape: Many, name: str, left_out: list[str]) -> list[Any]:
    found = []
    for i, item in enumerate(value):
        kept = shaped(item, shape.of, f"{name}[{i}]", left_out)
        if kept is None and isinstance(shape.of, Part):
            continue
        if kept is not _LACKS:
            found.append(kept)
    return found


def _object(value: dict[str, Any], shape: Part, name: str, left_out: list[str]) -> Any:
    found = {}
    for key, item in value.items():
        wanted = shape.keys.get(key, shape.rest)
        kept = item if wanted is None else shaped(item, wanted, f"{name}.{key}" if name else key, left_out)
        if kept is not _LACKS:
            found[key] = kept
    missing = [key for key in shape.needs if found.get(key) is None]
    if missing and found:
        left_out.append(f"its {name} has no {missing[0]} and is left out")
        return _LACKS
    if doubt := shape.doubt(found):
        raise Misshapen(f"its {name} {doubt}")
    return found


def short(value: Any) -> str:
    """A value as JSON, of 40 signs at most."""
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 40 else text[:37] + "…"
