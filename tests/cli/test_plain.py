"""Arguments made plain have the values, and the sentences, that Typer gives them."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import pytest
import typer
from hypothesis import example, given
from hypothesis import strategies as st
from typer.core import TyperCommand

from eaid.cli import plain
from eaid.cli.plain import PlainCommand


def command(
    paths: Annotated[list[Path] | None, typer.Argument()] = None,
    real: Annotated[float, typer.Option("--real")] = 2,
    maybe: Annotated[float | None, typer.Option("--maybe")] = None,
    whole: Annotated[int, typer.Option("--whole")] = 3,
    text: Annotated[str, typer.Option("--text")] = "a",
    output: Annotated[Path | None, typer.Option("--output")] = Path("x"),
    there: Annotated[Path | None, typer.Option("--there", exists=True)] = None,
    small: Annotated[int, typer.Option("--small", max=9)] = 1,
    flag: Annotated[bool, typer.Option("--flag/--no-flag")] = False,
) -> None:
    raise GotError(locals())


class GotError(Exception):
    def __init__(self, values: dict) -> None:
        self.values = values


def outcome(kind, words):
    """What one of the two classes makes of a command line: the values with their types, or the sentence."""
    app = typer.Typer(add_completion=False)
    app.command(cls=kind)(command)
    try:
        app(args=words, standalone_mode=False)
    except GotError as got:
        return {key: (type(value), value) for key, value in got.values.items()}
    except Exception as fault:
        sentence = getattr(fault, "format_message", None)
        return sentence() if sentence else repr(fault)
    return None


def same(*words: str) -> object:
    ours, theirs = outcome(PlainCommand, list(words)), outcome(TyperCommand, list(words))
    assert repr(ours) == repr(theirs)
    return ours


NUMBERS = [
    "0", "-0", "+7", "007", "1.5", ".5", "5.", "1e3", "1E-3", "1e400", "-1e-400", "nan", "inf", "-inf", "1_000", "1.",
    "", " 3 ", "3\n", "0x10", "٣", "１", "12345678901234567890123", "1e", "e5", "--3", "1,5", "1d3", "True", "None",
    "1e9999",
]  # fmt: skip


@pytest.mark.parametrize("word", NUMBERS)
@pytest.mark.parametrize("option", ["--real", "--maybe", "--whole", "--small"])
def test_numbers(option, word):
    same(f"{option}={word}")


@given(
    st.one_of(st.floats().map(repr), st.integers().map(str), st.text(st.sampled_from("+-.0123456789eE_ "), max_size=9))
)
@example("1e5")
def test_any_number(word):
    same(f"--real={word}", f"--whole={word}")


@pytest.mark.parametrize("word", ["", "a b", "ü", "-1", "x" * 5000, "a\x00b"])
def test_texts_and_paths(word):
    same(f"--text={word}", f"--output={word}")
    same("--", word, "b")


def test_paths_that_are_there(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path, tmp_path / "file", tmp_path / "none"):
        same(str(path), str(path), "--output", str(path))
        same("--there", str(path))
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    same(str(tmp_path / "loop"))


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything")
def test_a_path_that_may_not_be_read(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "file").chmod(0)
    assert "not readable" in str(same(str(tmp_path / "file")))


def test_a_path_that_may_not_be_read_is_left_to_typer(tmp_path, monkeypatch):
    monkeypatch.setattr(plain.os, "access", lambda *_: False)
    assert "is not readable" in str(same(str(tmp_path)))


def test_nothing_given_and_flags():
    got = same()
    assert got["real"] == (float, 2.0) and got["maybe"][1] is None
    same("--flag")
    same("--no-flag", "a")
    same("--unknown")
    same("--real")


def test_a_limit_is_still_kept():
    assert "--small" in str(same("--small", "10"))


def test_a_command_line_without_faults_needs_no_pydantic(tmp_path):
    code = """
import sys
from eaid.cli.main import run
assert run(["plan", "--help"]) == 0
assert run(["fit", "nowhere.csv", "--seed", "3", "--rest", "0.5", "--force", "-q", "-o", "f.json"]) == 3
print([name for name in sys.modules if "pydantic" in name])
"""
    end = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True)
    assert end.stdout.splitlines()[-1] == "[]"
