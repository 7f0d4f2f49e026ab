"""A command's options, declared once: a frozen dataclass whose fields say default, help and group.

    @dataclass(frozen=True, kw_only=True)
    class Arguments(Common):
        fit: Path = argument("FIT", "A fit.json.")
        rho: str = option("paper", "Reading of Eq. (15).", "Robust controller", words="paper|textbook")

    @takes(Arguments)
    def command(args: Arguments) -> int: ...

Typer gets a plain function with these parameters; what is typed becomes a value here, by `words` and `read`.
"""

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import typer

from eaid.cli import console
from eaid.cli.completion import completion
from eaid.cli.words import word_or_number
from eaid.errors import UsageError, unknown

A = TypeVar("A", bound="Common")
T = TypeVar("T")


@dataclass(frozen=True)
class Spec:
    """The declaration of one option or argument."""

    help: str
    group: str | None = None
    flags: tuple[str, ...] = ()
    """Empty: the field's name with dashes."""
    words: tuple[str, ...] = ()
    """What may be typed; with `read` also."""
    several: bool = False
    """Several of the words, with commas between them."""
    read: Callable[[str, str], Any] | None = None
    """(option, text) → value."""
    shown: str | None = None
    """What stands behind the option in the help."""
    levels: bool = False
    """Levels of the data, which the shell completes."""
    positional: bool = False
    kept: bool = True
    """Whether a result keeps it: what changes no number is not kept."""


def argument(shown: str, help: str) -> Any:
    """A field that is given by its place."""
    return field(metadata={"spec": Spec(help, shown=shown, positional=True)})


def option(
    default: Any,
    help: str,
    group: str,
    *flags: str,
    words: str | tuple[str, ...] = (),
    number: bool = False,
    **more: Any,
) -> Any:
    """A field that is given by its name; `words` also as `a|b`, or a `number`; `more` are fields of `Spec`."""
    each = tuple(words.split("|")) if isinstance(words, str) else words
    more |= {"read": word_or_number(*each)} if number else {}
    return field(default=default, metadata={"spec": Spec(help, group, flags, each, **more)})


OUTPUT = "Output"
SHORT = 20
"""Letters of a list of words that stand behind an option; longer ones stand in its help."""


def written(default: str, help: str = "Where the result is written.") -> Any:
    """The field of the output."""
    return option(Path(default), help, OUTPUT, "-o", "--output")


@dataclass(frozen=True, kw_only=True)
class Common:
    """Options of every command."""

    force: bool = option(False, "Overwrite an existing output.", OUTPUT)
    json: bool = option(False, "Print the result, machine-readable, on stdout.", OUTPUT)
    words: tuple[str, ...] = ()
    """What was typed, but for what only says where the result goes and how it is shown."""
    quiet: bool = option(False, "No messages, tables or progress; errors are still told.", OUTPUT, "-q", "--quiet")


@dataclass(frozen=True, kw_only=True)
class Verbose:
    """Of commands that have more to tell."""

    verbose: bool = option(False, "Tell all findings and show all tables.", OUTPUT, "-v", "--verbose")


@dataclass(frozen=True, kw_only=True)
class Seeded:
    """Of commands that draw."""

    seed: int = option(0, "Of everything random; the same seed gives the same bytes.", "Chance")


COMMON = ["output", *(one.name for kind in (Seeded, Common, Verbose) for one in fields(kind))]


def takes(arguments: type[A]) -> Callable[[Callable[[A], int | None]], Callable[..., int | None]]:
    """Make of a function of `arguments` one that Typer takes as a command."""
    own = set(arguments.__annotations__) - {"output"}
    # first the command's own, then what it shares with others, last what all have
    options = [one for one in fields(arguments) if one.metadata]
    shown = sorted(options, key=lambda one: (one.name in COMMON, one.name not in own and one.name != "output"))
    hints = get_type_hints(arguments)

    def made(body: Callable[[A], int | None]) -> Callable[..., int | None]:
        def command(**typed: Any) -> int | None:
            console.be_quiet(typed["quiet"])
            values = {one.name: _value(one, typed[one.name]) for one in shown}
            return body(arguments(**values, words=_words(shown, typed)))

        command.__doc__ = body.__doc__
        command.__signature__ = inspect.Signature([_parameter(one, hints[one.name]) for one in shown])  # type: ignore[attr-defined]
        return command

    return made


def taken(kind: Callable[..., T], args: object, **more: Any) -> T:
    """An options type of the library, from the fields that bear the same names and from `more`; None: not given."""
    same = {name: getattr(args, name, None) for name in inspect.signature(kind).parameters if name not in more}
    return kind(**{name: value for name, value in same.items() if value is not None}, **more)


def refuse_idle(args: object, names: Sequence[str], because: str) -> None:
    """Refuse options that were given and do nothing; `because` says why, `without --optimize`."""
    options = [one for one in fields(args) if one.name in names]  # type: ignore[arg-type]
    idle = [flag_of(one) for one in options if getattr(args, one.name) != one.default]
    if idle:
        raise UsageError(f"{idle[0]}: does nothing {because}; leave it out")


def flag_of(one: "Field[Any]") -> str:
    """The option as it is typed, `--pi-gains`."""
    spec: Spec = one.metadata["spec"]
    flag = next((flag for flag in spec.flags if flag.startswith("--")), "--" + one.name.replace("_", "-"))
    return flag.partition("/")[0]


def _parameter(one: "Field[Any]", hint: Any) -> inspect.Parameter:
    """One parameter as Typer wants it: what is read or chosen here is a text there."""
    spec: Spec = one.metadata["spec"]
    text = bool(spec.words or spec.read)
    default = ... if one.default is MISSING else _typed(one.default) if text else one.default
    kind = typer.Argument if spec.positional else typer.Option
    flags = () if spec.positional else spec.flags or (_flags(one),)
    complete = completion(spec.words, spec.several, spec.levels)
    info = kind(
        default, *flags, help=_help(spec), metavar=_metavar(spec, hint), autocompletion=complete,
        show_default=default is not None and default is not False, rich_help_panel=spec.group,
    )  # fmt: skip
    return inspect.Parameter(
        one.name, inspect.Parameter.KEYWORD_ONLY, default=info, annotation=(str | None) if text else hint
    )


def _flags(one: "Field[Any]") -> str:
    flag = flag_of(one)
    return f"{flag}/--no-{flag[2:]}" if one.default is True else flag


def _metavar(spec: Spec, hint: Any) -> str | None:
    """What stands behind the option: the words where they are few, else WORD; nothing behind a switch."""
    if spec.levels:
        return "LEVELS"
    if spec.shown or not spec.words:
        return spec.shown or {bool: "", bool | None: "", list[Path] | None: "FILE"}.get(hint)
    words = "|".join(spec.words) + (",…" if spec.several else "|NUMBER" if spec.read else "")
    return words if len(words) <= SHORT else "WORD,…" if spec.several else "WORD|NUMBER" if spec.read else "WORD"


def _help(spec: Spec) -> str:
    """The help, with the words where they do not stand behind the option, in the Markdown that Typer shows."""
    said, behind = spec.help, _metavar(spec, None) or ""
    if any(word not in behind for word in spec.words):
        said = f"{said} {'Of' if spec.several else 'One of'} {', '.join(spec.words)}."
    return re.sub(r"([_*<`])", r"\\\1", said)


def _typed(value: Any) -> str | None:
    """A default as it would be typed."""
    if isinstance(value, tuple):
        return ",".join(_typed(part) or "" for part in value) or None
    return None if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def _exactly(value: Any) -> str:
    """A value as the shortest text that gives it back."""
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


def _value(one: "Field[Any]", typed: Any) -> Any:
    """What was typed, as a value; `UsageError` where it is none of the words, or cannot be read."""
    spec: Spec = one.metadata["spec"]
    if isinstance(typed, str) and typed.encode(errors="replace").decode() != typed:
        raise UsageError(f"{flag_of(one)} {typed!r}: is not UTF-8; type it in a terminal that writes UTF-8")
    if not isinstance(typed, str) or not (spec.words or spec.read):
        return one.default if typed is None and one.default is not MISSING else typed
    if typed == _typed(one.default):
        return one.default
    option_, parts = flag_of(one), [part.strip() for part in typed.split(",") if part.strip()]
    if spec.several:
        for part in parts or [typed]:
            if part not in spec.words:
                raise UsageError(unknown(option_, part, spec.words))
            if parts.count(part) > 1:
                raise UsageError(f"{option_} {typed}: name each once")
        return tuple(parts)
    if typed in spec.words or spec.read is None:
        if typed not in spec.words:
            raise UsageError(unknown(option_, typed, spec.words))
        return typed
    return spec.read(option_, typed)


def _words(shown: "Sequence[Field[Any]]", typed: Mapping[str, Any]) -> tuple[str, ...]:
    """The arguments and options as they were typed, those left at their defaults not."""
    placed: list[str] = []
    named: list[str] = []
    for one in shown:
        spec: Spec = one.metadata["spec"]
        value, flag = typed[one.name], flag_of(one)
        default = _typed(one.default) if spec.words or spec.read else one.default
        if spec.group == OUTPUT or not spec.kept or value in (None, [], default):
            continue
        each = value if isinstance(value, list) else [value]
        if spec.positional:
            placed += map(str, each)
        elif isinstance(value, bool):
            named.append(flag if value else f"--no-{flag[2:]}")
        else:
            named += [word for part in each for word in (flag, _exactly(part))]
    return *placed, *named
