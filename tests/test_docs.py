"""The docs keep up with the code: every key of a result file is explained, every shown command is a real one."""

import json
import re
import runpy
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import eaid
from eaid.cli import main

ROOT = Path(__file__).parents[1]
FILES = (ROOT / "docs" / "files.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ALWAYS = (
    "schema", "eaid", "digest", "seed", "command", "inputs…", "data.inputs…", "options…", "findings[]…", "warnings",
    "input_unit", "output_unit",
)  # fmt: skip


def keys(value: Any, at: str = "") -> Iterator[str]:
    """Dotted paths of all leaves; `[]` for each entry of a list of objects."""
    if isinstance(value, dict):
        for name, item in value.items():
            yield from keys(item, f"{at}.{name}" if at else name)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for item in value:
            yield from keys(item, f"{at}[]")
    else:
        yield at


def explained(section: str) -> list[re.Pattern[str]]:
    """The keys of one section of docs/files.md, `…` standing for any rest."""
    part = FILES.split(f"\n## {section}", 1)[1].split("\n## ", 1)[0]
    cells = [row.split("|")[1] for row in part.splitlines() if row.startswith("| `")]
    patterns = [*ALWAYS, *(name for cell in cells for name in re.findall(r"`([^`]+)`", cell))]
    return [re.compile(re.escape(pattern).replace("…", ".*")) for pattern in patterns]


@pytest.fixture(scope="module")
def results() -> dict[str, Any]:
    """Small results of every kind."""
    small = {"levels": (20.0, 40.0, 60.0, 80.0, 100.0), "rate_hz": 20.0, "repeats": 2}
    clutch, force = eaid.synth(**small), eaid.synth(rate_hz=20.0, repeats=2, kind="friction-force")
    fit = eaid.fit(clutch, hold_out=(40.0,))
    gains = eaid.tune_rc(fit)
    random = eaid.synth(excitation="random", rate_hz=20.0, shape={"duration_s": 40.0})
    days = [(f"s{k}", u, u * (1 + 0.1 * k), 0.01) for k in range(4) for u in (20.0, 60.0, 100.0)]
    return {
        "fit.json": fit, "force.json": eaid.fit(force), "gains.json": gains,
        "recorded.json": eaid.fit(random, shape="one"),
        "rig.json": eaid.sessions(pd.DataFrame(days, columns=["session", "level", "value", "sd_log"])),
        "compare.json": eaid.compare(fit, eaid.fit(eaid.synth(**small, seed=1)), gains=gains),
        "couple.json": eaid.couple(fit, gains, torque=(1.0,), loops=("pi",), replay=False),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "section"),
    [
        ("fit.json", "fit.json"), ("force.json", "fit.json"), ("recorded.json", "fit.json"),
        ("gains.json", "gains.json"), ("rig.json", "rig.json"), ("compare.json", "rig.json"),
        ("couple.json", "couple.json"),
    ],
)  # fmt: skip
def test_every_key_of_a_result_is_explained(results: dict[str, Any], name: str, section: str, tmp_path: Path) -> None:
    results[name].save(tmp_path / name)
    known = explained(section)
    found = dict.fromkeys(keys(json.loads((tmp_path / name).read_text(encoding="utf-8"))))
    assert len(found) > 20
    assert [key for key in found if not any(p.fullmatch(key) or p.fullmatch(f"{key}[]") for p in known)] == []


def shown_commands(page: Path) -> list[list[str]]:
    """Every `eaid …` line of a page's code blocks."""
    text = page.read_text(encoding="utf-8")
    blocks = re.findall(r"^```[a-z]*\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [
        shlex.split(line.removeprefix("$ "), comments=True) for line in lines if line.startswith(("$ eaid ", "eaid "))
    ]


PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
WITH_COMMANDS = [ROOT / "README.md", *(ROOT / "docs" / page for page in ("walkthrough.md", "sessions.md"))]


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_COMMANDS[:2], ids=["README", "walkthrough"])
def test_commands_print_what_is_shown(
    page: Path, run_eaid: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Line by line, … for any rest, until the logs of others; blanks count once."""
    monkeypatch.chdir(tmp_path)
    text = page.read_text(encoding="utf-8").split("\n## Your own logs")[0].split("\n## Logs of a real rig")[0]
    for block in re.findall(r"^```\n(\$ eaid .*?)^```", text, re.MULTILINE | re.DOTALL):
        for part in block.split("$ eaid ")[1:]:
            line, *shown = part.splitlines()
            if line.startswith("demo"):
                continue
            ran = run_eaid(*shlex.split(line))
            printed = [" ".join(one.split()) for one in (ran.out + "\n" + ran.err).splitlines()]
            for one in filter(None, shown):
                wanted = re.compile(re.escape(" ".join(one.split())).replace("…", ".*"))
                assert any(wanted.fullmatch(row) for row in printed), (line, one, printed)


COMMANDS = set(main.COMMANDS)


def test_every_command_is_shown_and_has_the_options_it_is_shown_with(run_eaid: Callable[..., Any]) -> None:
    commands = [command for page in WITH_COMMANDS for command in shown_commands(page)]
    assert {command[1] for command in commands} == COMMANDS
    for name in COMMANDS:
        told = run_eaid(name, "--help")
        assert told.code == 0
        for command in (command for command in commands if command[1] == name):
            for option in (word.split("=")[0] for word in command[2:] if word.startswith("-")):
                assert re.search(rf"(?<![\w-]){re.escape(option)}(?![\w-])", told.out), (command, option)


def promised() -> Iterator[tuple[str, str]]:
    """Command and option, of all that the contract says scripts use."""
    page = (ROOT / "docs" / "contract.md").read_text(encoding="utf-8").split("Options that scripts use:\n\n- ")[1]
    for row in page.split("\n\n")[0].split("\n- "):
        parts = re.findall(r"`([a-z-]+) (--[^`]*)`", row) if row.startswith("`synth") else [(row.split("`")[1], row)]
        for name, words in parts:
            options = re.findall(r"--[a-z][a-z-]+", words.replace("`simulate --log`", ""))
            yield from ((name, option) for option in options)
            if name == "ingest":  # what reads logs
                yield from (("fit", option) for option in options)


def test_the_options_that_scripts_use_are_those_of_their_commands(run_eaid: Callable[..., Any]) -> None:
    wanted = [*promised(), *(("simulate", option) for option in ("--columns", "--units", "--repair"))]
    told = {name: re.findall(r"--[a-z][a-z-]+", run_eaid(name, "--help").out) for name in {name for name, _ in wanted}}
    assert len(wanted) > 60 and set(told) == {"ingest", "fit", "tune-rc", "simulate", "synth", "plan", "export"}
    assert [one for one in wanted if one[1] not in told[one[0]]] == []


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= 700


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
        if not target.startswith("http") and target != "reference/commands.md":  # made while the site is built
            assert (page.parent / target).exists(), target


def test_contributing_names_files_that_exist() -> None:
    text = CONTRIBUTING + (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([\w./-]+/[\w./-]+\.(?:py|md|yml|txt))`", text))
    assert len(named) > 30
    assert [name for name in sorted(named) if not any((at / name).exists() for at in (ROOT, ROOT / "eaid"))] == []


def test_every_room_stands_in_the_list_of_rooms_in_the_order_of_the_layers() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    layers = re.findall(r'"eaid\.(\w+)"', project.split("layers = [")[1].split("]")[0])[::-1]
    rows = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").split("|---|---|---|\n")[1].split("\n\n")[0]
    rooms = [name.strip("/") for row in rows.splitlines() for name in re.findall(r"`([\w/]+)`", row.split("|")[1])]
    assert sorted(rooms) == sorted(layers)
    packages = [room for room in rooms if (ROOT / "eaid" / room).is_dir()]
    assert packages == [layer for layer in layers if layer in packages]


def test_the_certified_rows_of_the_benchmarks_are_what_their_script_makes() -> None:
    made = runpy.run_path(str(ROOT / "docs" / "benchmarks_table.py"))
    page = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    assert f"| {made['boxbod']()} |" in page and f"| {made['dyestuff']()} |" in page


@pytest.mark.slow
def test_the_table_of_the_paper_is_what_its_script_makes() -> None:
    """In words; another processor may round a number's last digit otherwise."""
    made, number = runpy.run_path(str(ROOT / "docs" / "paper_table.py")), re.compile(r"[-+]?\d+(?:\.\d+)?(?:e-?\d+)?")
    page = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    kept = page.split(made["BEGIN"])[1].split(made["END"])[0]
    assert number.sub("#", made["table"]()) == number.sub("#", kept)
