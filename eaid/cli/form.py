"""A command's options, those of `eaid.options` and its own: parameters that Typer takes, and what is typed as values.

@takes
def tune_rc(args: Common, how: TuneOptions, fit: Path = argument("FIT", "A fit.json.")) -> None: ...
"""

import inspect
import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from eaid.cli import console
from eaid.declared import Declaration, OptionForm, Options, as_typed, forms, option, part
from eaid.errors import DataError, UsageError
from eaid.options import CHANCE, ReadOptions

if TYPE_CHECKING:
    from eaid.findings import Finding
    from eaid.report.tables import Table
    from eaid.results.fit import Fit

R = TypeVar("R")
OUTPUT, PLACE = "Output", "Arguments"
SHORT_LIST = 20  # Letters of a list of words that stand behind an option; longer ones stand in its help


def argument(shown: str, help: str, default: Any = MISSING) -> Any:
    """A field that is given by its place."""
    return field(default=default, metadata={"option": Declaration(help, PLACE, shown=shown)})


def written(default: str, help: str = "Where the result is written.") -> Any:
    """The field of the output."""
    return option(Path(default), help, OUTPUT, "-o", "--output")


@dataclass(frozen=True, kw_only=True)
class Common(Options):
    """Options of every command."""

    force: bool = option(False, "Overwrite an existing output.", OUTPUT)
    json: bool = option(False, "Print the result, machine-readable, on stdout.", OUTPUT)
    quiet: bool = option(False, "No messages, tables or progress; errors are still told.", OUTPUT, "-q", "--quiet")
    verbose: bool = option(False, "Tell all findings and show all tables.", OUTPUT, "-v", "--verbose", "--tables")
    typed: tuple[str, ...] = ()  # What was typed, but for what only says where the result goes and how it is shown


def takes(body: Callable[..., int | None]) -> Callable[..., int | None]:
    """Make a command for Typer of a function. A parameter of an options type stands for all options of that type (of
    `Common`: for all that was typed), any other is an option of the command's own."""
    parameters = inspect.signature(body).parameters.values()
    sets = {one.name: one.annotation for one in parameters if one.default is inspect.Parameter.empty}
    own = [(one.name, one.annotation, one.default) for one in parameters if one.name not in sets]
    arguments = make_dataclass("Arguments", own, bases=tuple(sets.values()), frozen=True, kw_only=True)
    shown = sorted(forms(arguments).values(), key=lambda form: form.declared.group in (CHANCE, OUTPUT))

    def command(**typed: Any) -> int | None:
        console.QUIET.set(typed["quiet"])
        for form in shown:
            if form.parts[0] in (Path, list[Path]) and (value := typed[form.name]):
                typed[form.name] = Path(value) if form.parts[0] is Path else list(map(Path, value))
            elif form.parts[0] == Mapping[str, str]:  # once with commas, or again and again
                typed[form.name] = ",".join(typed[form.name] or ()) or None
        if placed := typed.get("gains_placed"):
            if typed["gains"] is not None:
                raise UsageError("GAINS and --gains: give one of them")
            typed |= {"gains": placed, "gains_placed": None}
        given = {form.name: typed[form.name] for form in shown if typed[form.name] not in (None, _default(form))}
        for text in given.values():
            if isinstance(text, str) and text.encode(errors="replace").decode() != text:
                raise UsageError(f"{text!r}: is not UTF-8; type it in a terminal that writes UTF-8")
        args = arguments(**given, typed=_typed_words(shown, typed))
        each = {name: args if issubclass(kind, Common) else part(kind, args) for name, kind in sets.items()}
        try:
            return body(**each, **{name: getattr(args, name) for name, *_ in own})
        except DataError as fault:  # what reading proposes keeps what else was asked for
            more = [form for form in shown if form.declared.group != PLACE and form.name not in forms(ReadOptions)]
            rest = shlex.join(word for form in more for word in _named(form, typed[form.name]))
            told = [f"{one} {rest}".rstrip() if one.startswith("try: ") else one for one in fault.sentences]
            raise DataError(*told) from None

    command.__doc__ = body.__doc__
    command.__signature__ = inspect.Signature([_parameter(form) for form in shown])  # type: ignore[attr-defined]
    return command


def refuse_idle(args: Options, names: Sequence[str], because: str) -> None:
    """Refuse options that were given and do nothing; `because` says why, `without --optimize`."""
    for name in args.given():
        if name in names:
            raise UsageError(f"{forms(type(args))[name].flag}: does nothing {because}; leave it out")


PLAIN_TYPES = (bool, Path, list[Path])  # Types that Typer hands over; all else it hands over as a text


def _default(form: OptionForm) -> Any:
    """A default as Typer hands it over."""
    return form.default if form.parts[0] in PLAIN_TYPES else as_typed(form.default) or None


def _parameter(form: OptionForm) -> inspect.Parameter:
    """One parameter as Typer wants it."""
    declared, placed = form.declared, form.declared.group == PLACE
    default = ... if form.default is MISSING else _default(form)
    kind = typer.Argument if placed else typer.Option
    both = f"{form.flag}/--no-{form.flag[2:]}" if form.default is True else form.flag
    flags = () if placed else declared.flags or (both,)
    help, behind = declared.help, _metavar(form)
    if any(word not in behind for word in declared.words):
        help = f"{help} {'Of' if form.several else 'One of'} {', '.join(declared.words)}."
    info = kind(
        default, *flags, help=re.sub(r"([_*<`])", r"\\\1", help), metavar=behind,  # in the Markdown that Typer shows
        show_default=default is not None and default is not False, rich_help_panel=None if placed else declared.group,
    )  # fmt: skip
    hint = form.parts[0] if form.parts[0] in PLAIN_TYPES else list[str] if form.parts[0] == Mapping[str, str] else str
    return inspect.Parameter(
        form.name, inspect.Parameter.KEYWORD_ONLY, default=info, annotation=hint if default is not None else hint | None
    )


def _metavar(form: OptionForm) -> str:
    """What stands behind the option: the words where they are few, else WORD; nothing behind a switch."""
    declared, kind, number = form.declared, form.parts[0], float in form.parts
    if declared.levels:
        return "LEVELS"
    if declared.shown or not declared.words:
        plain = {bool: "", list[Path]: "FILE", Path: "PATH", str: "TEXT", tuple[float, ...]: "NUMBER,…"}
        return declared.shown or plain.get(kind, "NUMBER")
    words = "|".join(declared.words) + (",…" if form.several else "|NUMBER" if number else "")
    return words if len(words) <= SHORT_LIST else "WORD,…" if form.several else "WORD|NUMBER" if number else "WORD"


def _typed_words(shown: Sequence[OptionForm], typed: Mapping[str, Any]) -> tuple[str, ...]:
    """The arguments and options as they were typed, those left at their defaults not."""
    kept = [form for form in shown if form.declared.group != OUTPUT and form.declared.kept]
    placed = [str(one) for form in kept if form.declared.group == PLACE for one in _values(typed[form.name])]
    return *placed, *(word for form in kept if form.declared.group != PLACE for word in _named(form, typed[form.name]))


def _values(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [] if value is None else [value]


def _named(form: OptionForm, value: Any) -> list[str]:
    """An option as it was typed; nothing of one that was left at its default."""
    if value in (None, [], _default(form)):
        return []
    if isinstance(value, bool):
        return [form.flag if value else f"--no-{form.flag[2:]}"]
    return [word for part in _values(value) for word in (form.flag, str(part))]


def tell_result(
    args: Common, result: object, shown: "Iterable[Table | str]", findings: "Iterable[Finding]", kind: str = ""
) -> None:
    """Print a result, by its lines and tables or with --json as its file, and tell the findings."""
    if args.json:
        console.print_json(result, kind)
    else:
        console.show(*shown)
    console.tell(findings, args.verbose)


NOT_TO_BE_USED = 4  # Exit code of a fit whose verdict is that it must not be used; it is written, marked


def exit_code_of(fit: "Fit", output: Path) -> int:
    """0, or of a fit that must not be used 4, said of the file that it is written to."""
    if fit.verdict.usable:
        return 0
    console.fail(f"{output}: is written and marked; do not use its numbers")
    return NOT_TO_BE_USED


def stamped(result: R, args: Common, **files: Path | list[Path] | None) -> R:
    """A result that says what was typed, and names the files it was made from, where its own data do not."""
    import msgspec

    from eaid.results.common import Input

    named = {
        role: tuple(Input.of(one) for one in given if one.is_file()) if isinstance(given, list) else Input.of(given)
        for role, given in files.items()
        if given
    }
    more: dict[str, Any] = {"inputs": named} if files else {}
    return msgspec.structs.replace(result, command=args.typed, **more)  # type: ignore[type-var]
