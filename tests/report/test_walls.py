"""couple.json on the page: one figure, one table, with the file's own numbers."""

from pathlib import Path

import pytest

import eaid
from eaid.cli.main import run
from eaid.report.figures import coupling as figures
from eaid.report.results import read_results
from eaid.report.tables.gains import walls_tables


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("walls")
    fit = eaid.fit(eaid.synth(levels=(10.0, 40.0, 70.0, 100.0), repeats=2, rate_hz=50.0, clean=True))
    gains = eaid.tune_rc(fit)
    fit.save(where / "fit.json")
    eaid.couple(fit, gains, torque=(1.0, 2.0), replay=False).save(where / "couple.json")
    return where


@pytest.mark.slow
def test_the_page_has_the_figure_and_the_table(folder: Path, capsys: pytest.CaptureFixture[str]):
    files = [str(folder / name) for name in ("fit.json", "couple.json")]
    assert run(["report", *files, "-o", str(folder / "page"), "-q"]) == 0
    assert (folder / "page/figures/walls.png").stat().st_size > 10_000
    page = (folder / "page/report.html").read_text(encoding="utf-8")
    assert "How stiff a virtual wall may be" in page
    found = eaid.load(folder / "couple.json")
    table, pair = walls_tables(found)
    assert len(table.rows) == len(found.walls) and len(pair.rows) == len(found.pair) > 0
    first = f"{found.walls[1].K_passive:.3g}"
    assert first in page


def test_the_figure_shows_every_loop_with_its_greatest_demand(folder: Path):
    coupling = read_results([folder / "couple.json"]).couplings[0].result
    needed, region = figures.walls(coupling).axes
    assert {line.get_label() for line in needed.lines} >= {"open loop", "PI", "RC without rate", "RC"}
    dots = [line for line in needed.lines if line.get_marker() == "o"]
    passive = {
        wall.loop: wall.K_passive for wall in coupling.walls if wall.torque_nm == figures.middle_torque(coupling)
    }
    for dot, loop in zip(dots, figures.SHOWN, strict=True):
        assert dot.get_ydata()[0] == pytest.approx(coupling.options.limb_damping / passive[loop], rel=0.05)
    assert region.get_ylabel() == "stiffness (N·m/rad)"
