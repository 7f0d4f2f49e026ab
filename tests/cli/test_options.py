"""Options of all commands: read back as typed, refused with the word that was meant, completed by the shell, helped."""

import importlib
import os
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_type_hints

import pytest
import typer
from hypothesis import given, settings
from hypothesis import strategies as st

from eaid.cli import form, main
from eaid.coupling.linearised import LOOPS
from eaid.errors import UsageError
from eaid.export.options import LAWS
from eaid.export.targets import TARGETS
from eaid.fitting import choices as fitting
from eaid.reading import KINDS
from eaid.replay.controllers import CONTROLLERS
from eaid.replay.scenarios import SCENARIOS
from eaid.results.tuning import ALSO
from eaid.synth import excitation

ARGUMENTS = {name: importlib.import_module(f"eaid.cli.{name}").Arguments for name in main.COMMANDS}
TEXTS = {
    "columns": "time=Time", "units": "time=us", "variable": "x", "name_pattern": "_V={level}_", "levels": "30,100",
    "apparatus": "surfaces=1", "bounds_levels": "20:100", "hold_out": "40,70", "duty": "10:100", "want": "Ts=3",
    "limits": "rest=5", "plant": "fit.json", "shape": "duration_s=240", "torques": "1,2", "pi_gains": "20,300",
    "duty_limits": "5,95", "perturb": "Ts=0.9", "figures": "fig07", "width": "3,7", "font": "Arial",
    "reference": "multisine",
}  # fmt: skip
"""A text for each option that is read."""


def options_of(name: str) -> list[Any]:
    return [one for one in fields(ARGUMENTS[name]) if one.metadata]


def parsed(name: str, words: list[str]) -> Any:
    """What a command would be given."""
    caught: list[Any] = []
    app = typer.Typer()
    app.command()(form.takes(ARGUMENTS[name])(caught.append))
    app(args=words, standalone_mode=False)
    return caught[0]


@st.composite
def lines(draw: st.DrawFn, name: str) -> list[str]:
    """A line of arguments and some options with values."""
    hints, said = get_type_hints(ARGUMENTS[name]), []
    for one in options_of(name):
        told, flag = one.metadata["spec"], form.flag_of(one)
        text = str(hints[one.name])
        if told.positional:
            said.append("a.file")
        elif draw(st.booleans()):
            continue
        elif told.words:
            said += [flag, draw(st.sampled_from(told.words))]
        elif one.name in TEXTS:
            said += [flag, TEXTS[one.name]]
        elif "bool" in text:
            said.append(f"--no-{flag[2:]}" if one.default is True else flag)
        elif "float" in text:
            said += [flag, repr(draw(st.floats(allow_nan=False, allow_infinity=False)))]
        elif "int" in text:
            said += [flag, str(draw(st.integers(-(2**40), 2**40)))]
        else:
            said += [flag, "some.file"]
    return said


@pytest.mark.parametrize("name", ARGUMENTS)
@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_what_was_typed_comes_back_as_it_was(name: str, data: st.DataObject) -> None:
    """The words that a result keeps give the same options again."""
    line = data.draw(lines(name))
    first = parsed(name, line)
    again = parsed(name, list(first.words))
    told = {one.name: (one.metadata["spec"], one.default) for one in options_of(name)}
    shown = {key: plain for key, (said, plain) in told.items() if said.group == form.OUTPUT or not said.kept}
    assert replace(again, **shown) == replace(first, **shown)


def choices() -> list[tuple[str, Any]]:
    return [(name, one) for name in ARGUMENTS for one in options_of(name) if one.metadata["spec"].words]


@pytest.mark.parametrize(("name", "one"), choices(), ids=lambda value: getattr(value, "name", value))
def test_a_word_that_is_mistyped_is_told_the_one_meant(name: str, one: Any) -> None:
    told = one.metadata["spec"]
    if told.read is form_as_typed():
        pytest.skip("any text may stand there")
    word = max(told.words, key=len)
    wrong = f"{word[:-1]}ß"
    with pytest.raises(UsageError) as found:
        form._value(one, wrong)
    (sentence,) = found.value.sentences
    assert sentence.startswith(f"{form.flag_of(one)} {wrong}: must be ") and word in sentence
    if told.read is None and len(word) > 3:
        assert f"did you mean {word}?" in sentence


def form_as_typed() -> object:
    from eaid.cli.words import as_typed

    return as_typed


TABLES = {
    ("fit", "models"): fitting.MODELS, ("fit", "estimator"): fitting.ESTIMATORS, ("fit", "ci"): fitting.INTERVALS,
    ("fit", "loss"): fitting.LOSSES, ("fit", "shape"): fitting.SHAPES,
    ("fit", "kind"): KINDS, ("ingest", "kind"): KINDS, ("synth", "kind"): KINDS,
    ("tune_rc", "optimize_also"): ALSO, ("tune_rc", "reference"): tuple(SCENARIOS),
    ("simulate", "scenario"): (*SCENARIOS, "rehab"), ("simulate", "controllers"): tuple(CONTROLLERS),
    ("synth", "excitation"): (*excitation.KINDS, excitation.LOOPED), ("export", "laws"): LAWS,
    ("export", "target"): tuple(TARGETS), ("couple", "loops"): LOOPS,
}  # fmt: skip


@pytest.mark.parametrize(("place", "words"), TABLES.items(), ids=str)
def test_the_words_are_those_of_the_library(place: tuple[str, str], words: tuple[str, ...]) -> None:
    (one,) = (one for one in options_of(place[0]) if one.name == place[1])
    assert set(one.metadata["spec"].words) == set(words)


@pytest.mark.parametrize("name", ARGUMENTS)
def test_help_has_groups_choices_and_one_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    for one in options_of(name):
        assert one.metadata["spec"].positional or one.metadata["spec"].group, one.name
    assert main.run([name.replace("_", "-"), "--help"]) == 0
    shown = capsys.readouterr().out
    assert shown.count("Example: eaid") == 1
    said = " ".join(shown.replace("│", " ").split())
    for one in options_of(name):
        assert one.metadata["spec"].positional or form.flag_of(one) in shown
        for word in one.metadata["spec"].words:
            assert word in said, (one.name, word)


def completed(shell: str, line: str, where: Path) -> str:
    """What a shell gets offered behind a line."""
    wanted = {
        **os.environ, "_EAID_COMPLETE": f"complete_{shell}", "COMP_WORDS": line, "_TYPER_COMPLETE_ARGS": line,
        "COMP_CWORD": str(len(line.split(" ")) - 1), "_TYPER_COMPLETE_FISH_ACTION": "get-args",
    }  # fmt: skip
    call = [sys.executable, "-m", "eaid"]
    return subprocess.run(call, env=wanted, cwd=where, capture_output=True, text=True, check=False).stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_shell_offers_commands_options_words_and_levels(shell: str, tmp_path: Path) -> None:
    made = ["synth", "--levels", "25,50,75", "--repeats", "1", "--rate-hz", "20", "--hold", "2", "-q"]
    assert main.run([*made, "-o", str(tmp_path / "d.h5")]) == 0
    assert "simulate" in completed(shell, "eaid sim", tmp_path)
    assert "--estimator" in completed(shell, "eaid fit --est", tmp_path)
    assert "two-stage" in completed(shell, "eaid fit d.h5 --estimator t", tmp_path)
    assert "rc,pi-feedforward" in completed(shell, "eaid simulate f.json --controller rc,pi-", tmp_path)
    assert {"25", "50", "75"} <= set(completed(shell, "eaid fit d.h5 --hold-out ", tmp_path).replace('"', " ").split())
    assert completed(shell, "eaid fit d.h", tmp_path).strip() in ("", "_files")  # the shell itself offers files


@pytest.mark.parametrize(("shell", "file"), [("bash", ".bash_completions/eaid.sh"), ("zsh", ".zfunc/_eaid"),
                                             ("fish", ".config/fish/completions/eaid.fish")])  # fmt: skip
def test_completion_installs(shell: str, file: str, tmp_path: Path) -> None:
    home = {**os.environ, "HOME": str(tmp_path), "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    call = [sys.executable, "-m", "eaid", "--install-completion", shell]
    done = subprocess.run(call, env=home, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "_EAID_COMPLETE" in (tmp_path / file).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", main.COMMANDS)
def test_a_command_is_under_a_hundred_lines(name: str) -> None:
    """Parse, call, print, exit code: what is longer belongs in the library."""
    file = Path(main.__file__).parent / f"{name}.py"
    assert len(file.read_text(encoding="utf-8").splitlines()) < 100
