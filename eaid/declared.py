"""How an option is declared: a field of a frozen dataclass with its type, default, help, group, limits and words.

The command line, the keywords of the Python functions and all refusals derive from the
types in `eaid.options`. A field is one option:

    kp: float | None = option(None, "K_P [1/s²]; by itself 4.5.", ROBUST, least=-1e10, most=1e10)

Its type says how it is written: a number, a switch, words, `40,70`, `10:100`, `Ts=0.9,tau1=1.2`. Limits say what
a rig could ever ask for, not what is wise: within them every command ends, with a result or with a refusal that names
the cause.
"""

import contextlib
import csv
import inspect
import math
import operator
import os
import re
import sys
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar, Union

from eaid.apparatus import Apparatus
from eaid.errors import UsageError, in_python, unknown

O = TypeVar("O", bound="Options")  # noqa: E741
F = TypeVar("F", bound=Callable[..., Any])
ORDERS = {"<": operator.lt, "<=": operator.le}
NUMERIC = {int, float, tuple[float, ...], tuple[float, float], Mapping[str, float]}
# Option → what its pairs look like
PAIRS = {"«columns»": "time=Time,input=Volts", "«units»": "time=us,output=g", "«where»": "f=1000,w=2"}


@dataclass(frozen=True)
class Declaration:
    """What is said of an option beside its name, type and default."""

    help: str
    group: str
    flags: tuple[str, ...] = ()  # Empty: the name with dashes
    words: tuple[str, ...] = ()  # Empty: those of a `Literal` in its type
    least: float = 0  # Of a number, or of each of several
    most: float = 1e9
    above: bool = False  # The least value itself is left out
    shown: str | None = None  # What stands behind the option in the help
    read: Callable[[str, str], Any] | None = None  # (option, text) → value, where the type does not say it
    rises: str = ""  # How the first of two numbers stands to the second: < or <=
    levels: bool = False  # Levels of the data, which Python may also give as numbers
    kept: bool = True  # Whether a result keeps it: what changes no number is not kept


def option(default: Any, help: str, group: str, *flags: str, words: str | Sequence[str] = (), **more: Any) -> Any:
    """A field of an options type; `words` also as `a|b`, `more` are fields of `Declaration`."""
    each = tuple(words.split("|")) if isinstance(words, str) else tuple(words)
    metadata = {"option": Declaration(help, group, flags, each, **more)}
    if isinstance(default, dict):
        return field(default_factory=lambda: dict(default), metadata=metadata)
    return field(default=default, metadata=metadata)


@dataclass(frozen=True, kw_only=True)
class Options:
    """A set of options; a value that means nothing raises `UsageError`, one sentence for each."""

    def __post_init__(self) -> None:
        faults: list[str] = []
        for name, form in forms(type(self)).items():
            try:
                value = form.settled(getattr(self, name))
            except UsageError as fault:
                faults += fault.sentences
                continue
            object.__setattr__(self, name, value)
            faults += form.faults(value)
        if faults:
            raise UsageError(*faults)
        self.agree()

    def agree(self) -> None:
        """Refuse options that mean nothing together."""

    def given(self) -> dict[str, Any]:
        """The options that differ from their defaults."""
        values = {name: (getattr(self, name), form.default) for name, form in forms(type(self)).items()}
        return {name: value for name, (value, default) in values.items() if value != default}


@dataclass(frozen=True)
class OptionForm:
    """An option's name and type, taken apart: how its values are written and what they may be."""

    name: str
    hint: Any
    default: Any
    declared: Declaration

    @property
    def parts(self) -> tuple[Any, ...]:
        """The types that a value may have, None left out."""
        union = typing.get_origin(self.hint) in (Union, types.UnionType)
        each = typing.get_args(self.hint) if union else (self.hint,)
        return tuple(str if typing.get_origin(one) is Literal else one for one in each if one is not type(None))

    @property
    def taken(self) -> str:
        """The type as Python code may give it: words one by one, any sequence for several, texts as they are typed."""
        declared, found = self.declared, []
        words = ", ".join(f'"{word}"' for word in declared.words)
        word = f"Literal[{words}]" if words and declared.read is None else "str"
        for part in self.parts:
            if typing.get_origin(part) is tuple:
                one = ["float"] * (part == tuple[float, ...])
                found += ["Sequence[str]", word] if self.several else ["Sequence[float]", *one, "str"]
            elif part is Path:
                found += ["str", "os.PathLike[str]"]
            elif typing.get_origin(part) is not None:
                found += ["Mapping[str, Any]", "str"]
            else:
                found.append(word if part is str else part.__name__)
        found += ["Sequence[float]"] * declared.levels + ["None"] * (self.default is None)
        return " | ".join(dict.fromkeys(found))

    @property
    def several(self) -> bool:
        """Whether words stand in a list."""
        return bool(self.parts[0] == tuple[str, ...])

    @property
    def flag(self) -> str:
        """The option as it is typed, `--pi-gains`."""
        named = (flag for flag in self.declared.flags if flag.startswith("--"))
        return next(named, "--" + self.name.replace("_", "-")).partition("/")[0]

    def settled(self, value: Any) -> Any:
        """A value as the type has it; a text is read as it is typed on the command line."""
        kind = self.parts[0]
        if hasattr(value, "tolist"):  # a number or an array of NumPy, a Series
            value = value.tolist()
        if isinstance(value, str):
            return self._read(value)
        if type(value) is int and float in self.parts and abs(value) <= sys.float_info.max:
            return float(value)
        if kind == tuple[float, ...] and type(value) in (int, float):
            return (value,)
        if kind == Mapping[str, str]:
            return pairs(f"«{self.name}»", value)
        if self.declared.levels and isinstance(value, Sequence) and kind is str:
            return ",".join(f"{level:.17g}" for level in value)
        if typing.get_origin(kind) is tuple and isinstance(value, Sequence):
            return tuple(value)
        return Path(value) if kind is Path and isinstance(value, os.PathLike) else value

    def _read(self, text: str) -> Any:
        """What a text means; UsageError where it cannot be read, the text itself where `faults` says why."""
        name, kind = f"«{self.name}»", self.parts[0]
        if self.declared.read is not None:
            return self.declared.read(name, text)
        if self.several:
            return names(name, text)
        if text in self.declared.words:
            return text
        if kind == tuple[float, float]:
            text = text.replace(":", ",")  # 10:100, or 0,100
        readers = {tuple[float, ...]: comma_numbers, tuple[float, float]: comma_numbers, Mapping[str, float]: factors,
                   Mapping[str, str]: pairs}  # fmt: skip
        if kind in readers:
            return readers[kind](name, text)
        if {int, float} & set(self.parts):
            with contextlib.suppress(ValueError):
                value = float(text)
                return int(value) if int in self.parts and value.is_integer() else value
        return Path(text) if kind is Path else text

    def faults(self, value: Any) -> list[str]:
        """Why the option may not have this value, a sentence each."""
        if value is None and self.default is None:
            return []
        name, declared, kind = f"«{self.name}»", self.declared, self.parts[0]
        if kind is bool:
            return [] if isinstance(value, bool) else [f"{name} {value!r}: give True or False"]
        if NUMERIC & set(self.parts):
            if isinstance(value, str) and str in self.parts:
                fine = not declared.words or value in declared.words
                return [] if fine else [f"{name} {value}: must be {', '.join(declared.words)} or a number"]
            pair = kind == tuple[float, float]
            if typing.get_origin(kind) is tuple and (not isinstance(value, tuple) or (pair and len(value) != 2)):
                return [f"{name} {as_typed(value)}: give {f'two numbers, as {declared.shown}' if pair else 'numbers'}"]
            each = value if isinstance(value, tuple) else value.values() if isinstance(value, Mapping) else (value,)
            faults = [fault for one in each for fault in self._outside(one)]
            if declared.rises and not faults and not ORDERS[declared.rises](*value):
                faults = [f"{name} {value[0]:g}:{value[1]:g}: give two numbers, the lower one first"]
            return faults
        if self.several:
            if not isinstance(value, tuple):
                return [f"{name} {value!r}: give words"]
            if not value and self.default != ():
                return [f"{name}: names nothing; leave it out"]
            again = [f"{name}: names {word} twice" for word in set(value) if value.count(word) > 1]
            known = declared.words
            return again + [unknown(name, word, known) for word in value if known and word not in known]
        if declared.words and isinstance(value, str | int | float) and declared.read is None:
            return [] if value in declared.words else [unknown(name, value, declared.words)]
        if self.parts == (str,) and not isinstance(value, str):
            return [f"{name} {value!r}: give a text"]
        return []

    def _outside(self, value: Any) -> list[str]:
        declared, whole = self.declared, int in self.parts
        if isinstance(value, bool) or not isinstance(value, int | float):
            return [f"«{self.name}» {value!r}: is no number"]
        low = value > declared.least if declared.above else value >= declared.least
        if low and value <= declared.most and (not whole or value == math.floor(value)):
            return []
        limits = (declared.least, declared.most)
        least, most = (f"{end:g}" if isinstance(end, float) or end >= 10**17 else str(end) for end in limits)
        shown = f"{value:g}" if isinstance(value, float) else str(value)[:30]
        ends = f"above {least}, {most} at most" if declared.above else f"from {least} to {most}"
        words = "".join(f", or {word}" for word in declared.words)
        return [f"«{self.name}» {shown}: give a {'whole ' * whole}number {ends}{words}"]


def _forms(kind: type) -> dict[str, OptionForm]:
    hints, made = typing.get_type_hints(kind), {}
    for one in (one for one in fields(kind) if "option" in one.metadata):
        default = one.default if one.default_factory is MISSING else one.default_factory()
        hint, declared = hints[one.name], one.metadata["option"]
        literal = [each for each in (hint, *typing.get_args(hint)) if typing.get_origin(each) is Literal]
        words = declared.words or tuple(word for each in literal for word in typing.get_args(each))
        made[one.name] = OptionForm(one.name, hint, default, replace(declared, words=words))
    return made


forms: Callable[[type], dict[str, OptionForm]] = cache(_forms)  # The options of a set by name


def given_options(kind: type[O], options: O | None, keywords: Mapping[str, Any]) -> O:
    """Options given whole or by keywords; UsageError for an unknown keyword, or one that contradicts `options`."""
    if options is not None and not isinstance(options, kind):
        raise UsageError(f"options {options!r:.60}: give {kind.__name__}, or keywords")
    known = forms(kind)
    for name, value in keywords.items():
        if name not in known:
            raise UsageError(unknown("no such option", name, known))
        if options is not None:
            stated = getattr(options, name)
            if stated != known[name].default and stated != known[name].settled(value):
                raise UsageError(f"«{name}» {value}: the options given say {stated}; say it in one place")
    return kind(**keywords) if options is None else replace(options, **keywords)


def taking(kind: type[Options]) -> Callable[[F], F]:
    """Say in a function's signature and docstring which options its `**keywords` are: what editors and `help` show."""

    def told(function: F) -> F:
        own = inspect.signature(function)
        *kept, keywords = own.parameters.values()
        kept = [one.replace(annotation=_plain_type(one.annotation)) for one in kept]
        more = keywords_of(kind, own.parameters)
        function.__signature__ = own.replace(  # type: ignore[attr-defined]
            return_annotation=_plain_type(own.return_annotation), parameters=kept + [
                inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=one.default,
                                  annotation=_Written(one.taken)) for one in more
            ]
        )  # fmt: skip
        said = "".join(f"{one.name}\n    {in_python(one.declared.help)}{_words_of(one)}\n" for one in more)
        marker = f"**{keywords.name}\n    Fields of `{kind.__name__}`, each as above.\n"
        # without the indentation of the source, which Python 3.13 takes off itself
        function.__doc__ = inspect.cleandoc(function.__doc__ or "").replace(marker, said)
        return function

    return told


def keywords_of(kind: type[Options], own: Iterable[str]) -> list[OptionForm]:
    """The options of a set that a function takes by keyword beside its own parameters, the seed last."""
    found = [form for name, form in forms(kind).items() if name not in set(own)]
    return sorted(found, key=lambda form: form.name == "seed")


class _Written(str):
    """An annotation that stands as a text, shown without its quotes."""

    __slots__ = ()
    __repr__ = str.__str__


def _plain_type(annotation: Any) -> Any:
    return _Written(annotation) if isinstance(annotation, str) else annotation


def _words_of(form: OptionForm) -> str:
    unsaid = any(word not in form.declared.help for word in form.declared.words)
    return f" {'Of' if form.several else 'One of'} {', '.join(form.declared.words)}." if unsaid else ""


def part(kind: type[O], options: object) -> O:
    """Those options of a larger set that belong to one type."""
    return kind(**{name: getattr(options, name) for name in forms(kind)})


def as_typed(value: Any) -> str:
    """A value as it would be typed; nothing where there is none."""
    if isinstance(value, Mapping):
        plain = {role: name if re.fullmatch(r"[\w./%·°-]+", name) else f'"{name}"' for role, name in value.items()}
        return ",".join(f"{role}={name}" for role, name in plain.items())
    if isinstance(value, Apparatus):
        return ",".join(f"{each.name}={getattr(value, each.name)}" for each in fields(value))
    if isinstance(value, tuple):
        return ",".join(map(as_typed, value))
    return "" if value is None else f"{value:.12g}" if isinstance(value, float) else str(value)


def any_text(_name: str, text: str) -> str:
    """Any text."""
    return text


def comma_numbers(flag: str, text: str) -> tuple[float, ...]:
    """Numbers with commas between them."""
    try:
        return tuple(float(part) for part in names(flag, text))
    except ValueError:
        raise UsageError(f"{flag} {text}: write numbers with commas between them, as 40,70") from None


def spaced(flag: str, text: str) -> tuple[float, ...]:
    """`30,40,90`, or `from:to:step` with both ends."""
    try:
        if ":" not in text:
            return tuple(float(part) for part in text.split(","))
        start, end, step = (float(part) for part in text.split(":"))
        count = round((end - start) / step)
    except (ValueError, ZeroDivisionError, OverflowError):
        raise UsageError(f"{flag} {text}: give levels as 30,40,90 or as from:to:step") from None
    if not 0 <= count <= 10_000 or abs(start + count * step - end) > 1e-9 * abs(step):
        raise UsageError(f"{flag} {text}: the step does not lead from {start:g} to {end:g}")
    return tuple(start + k * step for k in range(count + 1))


def names(flag: str, text: str) -> tuple[str, ...]:
    """Names with commas between them."""
    parts = tuple(name.strip() for name in text.split(",") if name.strip())
    if not parts:
        raise UsageError(f"{flag} {text!r}: names nothing; leave it out, or give names with commas between them")
    return parts


def factors(flag: str, text: str) -> dict[str, float]:
    """`Ts=0.9,tau1=1.2`, or widths in percent: names with numbers."""
    try:
        return {name: float(value.removesuffix("%")) for name, value in pairs(flag, text).items()}
    except ValueError:
        raise UsageError(f"{flag} {text}: write numbers by their names, as Ts=0.9,tau1=1.2") from None


def pairs(flag: str, text: str | Mapping[str, Any] | None) -> dict[str, str]:
    """`time=Time,output="Load Cell"` as a dictionary; raises UsageError where it is written otherwise."""
    if not text or isinstance(text, Mapping):
        return {name: str(value) for name, value in (text or {}).items()}
    # a quote may open after the equals sign: move it in front of the pair, where csv expects it
    moved = re.sub(r'(^|,)\s*(\w+)\s*=\s*"', r'\1"\2=', text)
    try:
        cells = next(csv.reader([moved], skipinitialspace=True))
    except (csv.Error, StopIteration):
        raise UsageError(f"{flag} {text!r}: holds a line break; write all pairs on one line") from None
    values: dict[str, str] = {}
    for cell in cells:
        name, equals, value = (piece.strip() for piece in cell.partition("="))
        if not equals or not name or not value:
            example = PAIRS.get(flag, "Ts=4,tau1=9")
            raise UsageError(f"{flag} {text}: write name=value pairs with commas between them, as {example}")
        if name in values:
            raise UsageError(f"{flag} {text}: says {name} twice")
        values[name] = value
    return values


def keyed(kind: type[O], flag: str, text: str | Mapping[str, Any] | None, /, **given: Any) -> O:
    """`duration_s=240,hold_s=0.5:20`, or a mapping, as a set of options; `given` says some of them already."""
    known, values = forms(kind), dict(given)
    try:
        for name, value in (text if isinstance(text, Mapping) else pairs(flag, text)).items():
            if name not in known:
                raise UsageError(unknown(flag, name, sorted(known)))
            values[name] = known[name].settled(value)
            if given.get(name, values[name]) != values[name]:
                raise UsageError(f"{flag} {name}={value}: another option says {given[name]}; say it in one place")
        return kind(**values)
    except UsageError as fault:
        of_this = re.compile(f"«({'|'.join(known)})»")
        raise UsageError(*(of_this.sub(rf"{flag} \1", sentence) for sentence in fault.sentences)) from None
