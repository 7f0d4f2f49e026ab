"""The demo, whole: in an empty folder, offline, every file there, the page named at the end."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from eaid.cli import demo
from eaid.cli.main import run
from eaid.errors import EaidError


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demo") / "demo"
    assert run(["demo", "-o", str(folder), "-q"]) == 0
    return folder


def test_every_command_left_its_result(made: Path):
    names = {path.name for path in made.iterdir()}
    assert names >= {*demo.REPORTED, "plan.csv", "report.html", "figures"}
    assert len(list((made / "figures").glob("*.png"))) >= 18
    assert not [name for name in names if name.endswith(".part")]


def test_the_page_is_small_synthetic_by_name_and_complete(made: Path):
    text = (made / "report.html").read_text(encoding="utf-8")
    assert (made / "report.html").stat().st_size < 8e6
    assert "(synthetic data)</title>" in text
    assert "Not shown here" not in text
    for table in ("Table I", "Table II", "Table III", "Table IV"):
        assert f"<h3>{table}</h3>" in text


def test_no_file_names_the_machine(made: Path):
    for path in [*made.glob("*.json"), *made.glob("*.md"), *made.glob("*.html")]:
        text = re.sub(r"data:image/png;base64,[\w+/=]+", "", path.read_text(encoding="utf-8"))
        assert (
            str(made) not in text and str(Path.home()) not in text.replace("/root", "") and "site-packages" not in text
        )


def test_results_are_whole_results(made: Path):
    fit = json.loads((made / "fit.json").read_text(encoding="utf-8"))
    assert fit["converged"] and fit["data"]["kind"] == "clutch"
    gains = json.loads((made / "gains.json").read_text(encoding="utf-8"))
    assert gains["rc"]["K_P"] == 4.5 and gains["pi"]["K_I"] == 360


def test_a_folder_with_something_in_it_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "mine.txt").write_text("x")
    assert run(["demo", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"error: {tmp_path}: is not empty; give --force to write over it, or another -o\n"
    assert run(["demo", "-o", str(tmp_path / "mine.txt")]) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def _one_after_another(first: Any, second: Any, folder: Path, done: Callable[[], None]) -> None:
    """As `run_both`, without the process to which a stand-in cannot be sent."""
    for line in [*first, *second]:
        demo.run_line(line, folder)
        done()


def test_it_ends_by_naming_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    ran: list[str] = []
    monkeypatch.setattr(demo, "run_line", lambda line, _folder: ran.append(line[0]))
    monkeypatch.setattr(demo, "run_both", _one_after_another)
    monkeypatch.chdir(tmp_path)
    assert run(["demo"]) == 0
    assert capsys.readouterr().err.splitlines()[-1] == "demo/report.html: 14 commands; next: open it in a browser"
    assert ran[-1] == "report"
    assert set(ran) == {"ingest", "fit", "tune-rc", "simulate", "plan", "report"}


def test_a_failing_command_ends_the_demo_with_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(EaidError, match=r"the demo stopped at: eaid fit gone\.h5 \(exit code 3\)") as stopped:
        demo.run_line(("fit", "gone.h5"), tmp_path)
    assert stopped.value.exit_code == 3
    assert "gone.h5" in capsys.readouterr().err


def test_it_ends_with_five_numbers_of_its_own_files(made: Path):
    lines = demo.five_numbers(made)
    fit = json.loads((made / "fit.json").read_text(encoding="utf-8"))
    gains = json.loads((made / "gains.json").read_text(encoding="utf-8"))
    assert len(lines) == 5
    assert f"{fit['nonlinear']['fit_pct']:.1f} %" in lines[0]
    assert (
        f"{gains['replayed']['rc']['max_abs_error_nm']:.3g} | {gains['replayed']['pi']['max_abs_error_nm']:.3g}"
        in lines[2]
    )
