"""What eaid refuses, and the exit code that says so (0 is done, 1 a bug, 130 interrupted).

A sentence names an option in guillemets, `«step_at»`: Python then says `step_at=`, the command line `--step-at`.
"""

import re
from collections.abc import Iterable
from difflib import get_close_matches

_OPTION = re.compile("«([^»]+)»")
_PAIR = r'\w+=[^\s,;:)"]+'  # of an option's value, time=us
_VALUED = re.compile(rf"«([^»]+)»(?: (?:({_PAIR}(?:,{_PAIR})*)|('[^']+'|-?\d[\d.]*))(?=[\s;)]|,\s|$))?")
# Options whose flag is another word than their name; a test holds them against the declarations
FLAGS = {
    "target": "--as", "idle_s": "--idle", "release_s": "--release", "longest_hold_s": "--longest-hold",
    "hold_s": "--hold", "white_nm": "--noise-nm",
}  # fmt: skip


def in_python(sentence: str) -> str:
    """A sentence with its options as Python writes them: `step_at=`, `until=5`, `units="time=us"`."""
    return _VALUED.sub(
        lambda found: f'{found[1]}="{found[2]}"' if found[2] else f"{found[1]}={found[3] or ''}", sentence
    )


def on_command_line(sentence: str) -> str:
    """A sentence with its options as the command line writes them, `--step-at`."""
    return _OPTION.sub(lambda option: FLAGS.get(option[1], "--" + option[1].replace("_", "-")), sentence)


def unknown(name: str, value: object, known: Iterable[object]) -> str:
    """`«kind» clutc: must be one of clutch, friction-force; did you mean clutch?`"""
    words = [str(word) for word in known]
    return f"{name} {value}: must be one of {', '.join(words)}{meant(str(value), words)}"


def meant(value: str, known: Iterable[str]) -> str:
    """`; did you mean clutch?`, or nothing where no known word is like it."""
    near = get_close_matches(value, list(known), 1)
    return f"; did you mean {near[0]}?" if near else ""


class EaidError(Exception):
    """One or more plain sentences: what, where, and what to do. Shown to the user without a traceback."""

    exit_code = 1

    def __init__(self, *sentences: str) -> None:
        sentences = tuple(dict.fromkeys(sentences))  # parts of one log say the same
        typed = (on_command_line(one) if one.startswith("try: ") else in_python(one) for one in sentences)
        super().__init__("\n".join(typed))
        self.sentences = sentences


class UsageError(EaidError):
    """The command was called wrongly, or would overwrite a file without `--force`."""

    exit_code = 2


class DataError(EaidError):
    """The input data cannot be used; one sentence per fault, all faults of a call at once."""

    exit_code = 3


class GainsError(EaidError):
    """The gains are refused: not physical, out of reach, or unstable on the model."""

    exit_code = 5
