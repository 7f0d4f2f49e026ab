"""A fit that its data do not determine leaves its mark: gains.json, replay.h5, every page and every figure of them."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from eaid.cli import main
from eaid.replay import files as replay_files
from eaid.report import style
from eaid.report.draw import GAINS, PLANT, STRIP_IN, mark_of, marked
from eaid.report.results import read_results


def call(*arguments: str | Path) -> int:
    """One command, quiet."""
    return main.run([str(argument) for argument in arguments])


WHY = "one step cannot tell b0 from c0"


@pytest.fixture(scope="module")
def one_level(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Data, fit, gains and a replay of one level, used with --allow-unidentified."""
    folder = tmp_path_factory.mktemp("unidentified")
    made = {name: folder / name for name in ("data.h5", "fit.json", "gains.json", "steps.h5")}
    how = ["--levels", "50", "--repeats", "3", "--hold", "5", "--idle", "1", "--rate-hz", "100"]
    assert call("synth", *how, "-o", made["data.h5"], "-q") == 0
    assert call("fit", made["data.h5"], "-o", made["fit.json"], "-q") == 0
    assert call("tune-rc", made["fit.json"], "-o", made["gains.json"], "-q") == 3
    assert call("tune-rc", made["fit.json"], "--allow-unidentified", "-o", made["gains.json"], "-q") == 0
    steps = ["--scenario", "steps", "--duration", "9", "-o", made["steps.h5"]]
    assert call("simulate", made["fit.json"], "--gains", made["gains.json"], *steps, "-q") == 0
    return made


@pytest.fixture(scope="module")
def marked_page(one_level: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("marked") / "report"
    assert call("report", *one_level.values(), "-o", folder, "-q") == 0
    return folder / "report.html"


@pytest.mark.slow
def test_gains_and_replays_carry_it_on(
    one_level: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert WHY in json.loads(one_level["gains.json"].read_text())["unidentified"]
    said = replay_files.read(one_level["steps.h5"])[0].head.unidentified
    assert WHY in said["gains"] and "one level only" in said["plant"]
    out = ["-o", str(tmp_path / "r.h5"), "--duration", "9", "--scenario", "steps", "--json"]
    assert main.run(["simulate", str(one_level["fit.json"]), "--gains", str(one_level["gains.json"]), *out]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["unidentified"] == said
    assert "warning: the gains were made from a fit that is not identifiable (one level only" in told.err
    assert "it is marked" in told.err


@pytest.mark.parametrize("name", ["gains.json", "steps.h5"])
def test_either_file_alone_marks_the_page(name: str, one_level: dict[str, Path]) -> None:
    mark = mark_of(read_results([one_level[name]]))
    assert mark is not None and mark[0] == GAINS and any(WHY in why for why in mark[1])


def test_a_plant_that_is_not_determined_marks_its_replay(one_level: dict[str, Path], tmp_path: Path) -> None:
    out = ["--controller", "inverse", "--duration", "9", "--scenario", "steps", "-o", tmp_path / "r.h5", "-q"]
    assert call("simulate", one_level["fit.json"], *out) == 0
    mark = mark_of(read_results([tmp_path / "r.h5"]))
    assert mark is not None and mark[0] == PLANT


@pytest.mark.slow
def test_sound_results_have_no_mark(files: dict[str, Path], page: Path) -> None:
    assert mark_of(read_results(list(files.values()))) is None
    text = page.read_text(encoding="utf-8")
    assert GAINS not in text and 'class="mark"' not in text and "@top-left" not in text
    assert not replay_files.read(files["steps.h5"])[0].head.unidentified


@pytest.mark.slow
def test_every_section_and_every_figure_of_the_fit_is_marked(marked_page: Path, files: dict[str, Path]) -> None:
    text = marked_page.read_text(encoding="utf-8")
    assert text.count(f'<p class="running">{GAINS}</p>') == text.count("<section id=")
    assert f"<b>{GAINS}</b>" in text
    figures = marked_page.parent / "figures"
    for name, has_mark in (
        ("input_gain", True),
        ("fig11_steps", True),
        ("fig07_nonlinear_model", True),
        ("fig02_pwm", False),
    ):
        pixels = np.asarray(Image.open(figures / f"{name}.png").convert("RGB")).astype(int)
        strip = pixels[: int(0.18 * 300)]
        red = (strip[..., 0] > 180) & (strip[..., 1] < 130) & (strip[..., 2] < 60)
        assert (red.sum() > 1000) == has_mark, name


@pytest.mark.slow
def test_it_stands_on_every_screen_and_every_printed_page(browser: Any, marked_page: Path, tmp_path: Path) -> None:
    tab = browser.new_context(viewport={"width": 380, "height": 800}).new_page()
    tab.goto(marked_page.as_uri())
    tab.locator("html[data-ready=true]").wait_for(state="attached", timeout=60_000)
    tab.evaluate("window.scrollTo(0, document.body.scrollHeight / 2)")
    tab.wait_for_timeout(800)
    box = tab.locator(".mark").bounding_box()
    assert box["y"] == pytest.approx(0, abs=1) and box["height"] < 80
    assert tab.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    tab.emulate_media(media="print")
    printed = "[...document.querySelectorAll('.running')].filter(one => !one.closest('#appendix'))"
    assert tab.evaluate(f"{printed}.every(one => one.checkVisibility())")
    if shutil.which("pdftotext") is None:
        pytest.skip("no pdftotext, so the printed pages are not read")
    tab.pdf(path=tmp_path / "page.pdf", prefer_css_page_size=True)
    told = subprocess.run(["pdftotext", tmp_path / "page.pdf", "-"], capture_output=True, text=True, check=True).stdout
    pages = told.split("\f")[:-1]
    assert len(pages) > 1 and all(GAINS in one for one in pages)
    tab.context.close()


@pytest.mark.slow
def test_a_legend_of_the_whole_figure_stays_below_the_mark_and_above_the_panels() -> None:
    with style.look():
        figure, axes = style.sheet(5.0, 2.75, 2, 1)
        axes[1].plot([0, 1], [0, 1], label="measured")
        style.legend_over(figure, axes[1])
        marked(figure, PLANT)
        figure.canvas.draw()
        (legend,), height = figure.legends, figure.bbox.height
        box = legend.get_window_extent()
        assert box.y1 <= height - STRIP_IN * figure.dpi + 1
        assert box.y0 >= axes[0].get_window_extent().y1 - 1
