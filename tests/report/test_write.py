"""One entry for files and for memory; all of a report or nothing; nothing overwritten unasked; rebuilt on a change."""

from pathlib import Path
from typing import Any

import pytest

from eaid.cli.main import run
from eaid.errors import UsageError
from eaid.options import ReportOptions
from eaid.report import write
from eaid.report.results import read_results
from eaid.report.write import write_report


def names_in(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


ONE = ReportOptions(figures=("input_gain",))


@pytest.mark.slow
def test_results_in_memory_make_the_page_of_their_files(files: dict[str, Path], tmp_path: Path):
    given = read_results([files["clutch.json"]])
    made = write_report([given.fits[0].result], tmp_path / "memory", ONE)
    write_report(given, tmp_path / "files", ONE)
    assert made.figures == ("input_gain",)
    assert names_in(tmp_path / "memory") == ["figures/input_gain.png", "report.html"]
    held = [(tmp_path / name / "figures/input_gain.png").read_bytes() for name in ("memory", "files")]
    assert held[0] == held[1]
    with pytest.raises(UsageError, match="a dict is no result"):
        write_report([{}], tmp_path / "other")  # type: ignore[list-item]


@pytest.mark.slow
@pytest.mark.parametrize("held", ["report.html", "figures/input_gain.png", "figures/fig07_nonlinear_model.svg"])
def test_without_force_nothing_is_written_over(files: dict[str, Path], tmp_path: Path, held: str):
    (tmp_path / "out" / held).parent.mkdir(parents=True)
    (tmp_path / "out" / held).write_text("mine")
    arguments = ["report", str(files["clutch.json"]), "-o", str(tmp_path / "out"), "--figures", "input_gain", "-q"]
    assert run(arguments) == 2
    assert names_in(tmp_path / "out") == [held] and (tmp_path / "out" / held).read_text() == "mine"
    (tmp_path / "out/figures").mkdir(exist_ok=True)
    (tmp_path / "out/figures/notes.txt").write_text("mine too")
    assert run([*arguments, "--force"]) == 0
    # Old figures of a report go with the old page; what is not of a report stays.
    assert names_in(tmp_path / "out") == ["figures/input_gain.png", "figures/notes.txt", "report.html"]


@pytest.mark.slow
def test_a_report_that_breaks_off_leaves_what_was_there(
    files: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def broken(*_: Any) -> str:
        raise RuntimeError("broken")

    given = read_results([files["clutch.json"]])
    write_report(given, tmp_path / "old", ONE)
    before = {name: (tmp_path / "old" / name).read_bytes() for name in names_in(tmp_path / "old")}
    monkeypatch.setattr(write, "page", broken)
    for name in ("old", "new"):
        with pytest.raises(RuntimeError):
            write_report(given, tmp_path / name, force=True)
    assert {name: (tmp_path / "old" / name).read_bytes() for name in names_in(tmp_path / "old")} == before
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--figures", "fig99"], "--figures fig99: no such figure"),
        (["--format", "gif"], "--format gif: must be one of pdf, svg, png"),
        (["--width", "3.5"], "--width 3.5: write two numbers with a comma between them"),
        (["--width", "1,7"], "give a number from 2 to 40"),
        (["--font", "No Such Font"], "--font No Such Font: no such font is installed"),
    ],
)
def test_options_that_name_nothing_are_refused(
    files: dict[str, Path], tmp_path: Path, options: list[str], says: str, capsys: pytest.CaptureFixture[str]
):
    assert run(["report", str(files["clutch.json"]), "-o", str(tmp_path / "out"), *options]) == 2
    assert says in capsys.readouterr().err and not (tmp_path / "out").exists()
