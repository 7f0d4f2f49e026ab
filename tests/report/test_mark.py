"""A fit that its data do not determine leaves its mark: gains.json, replay.h5, every page and every figure of them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import eaid

GAINS = "Fit not identifiable: gains used with --allow-unidentified"
PLANT = "Fit not identifiable: the replays show a model that its data do not determine"
WHY = "one step cannot tell b0 from c0"


@pytest.fixture(scope="module")
def one_level(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Data, fit, gains and replays of one level, used with --allow-unidentified."""
    folder = tmp_path_factory.mktemp("unidentified")
    made = {name: folder / name for name in ("data.h5", "fit.json", "gains.json", "steps.h5", "inverse.h5")}
    steps = eaid.synth(levels=(50.0,), repeats=3, hold_s=5.0, idle_s=1.0, rate_hz=100.0)
    fit = eaid.fit(steps)
    with pytest.raises(eaid.DataError, match="b0"):
        eaid.tune_rc(fit)
    gains = eaid.tune_rc(fit, allow_unidentified=True)
    replay = eaid.simulate(fit, gains, "steps", duration=9.0)
    inverse = eaid.simulate(fit, None, "steps", controller=("inverse",), duration=9.0)
    for name, result in zip(made, (steps, fit, gains, replay, inverse), strict=True):
        result.save(made[name])
    return made


@pytest.fixture(scope="module")
def marked(one_level: dict[str, Path], report: Callable[..., Any]) -> Any:
    return report(*(path for name, path in one_level.items() if name != "inverse.h5"))


@pytest.mark.slow
def test_gains_and_replays_carry_it_on(one_level: dict[str, Path], tmp_path: Path, run_eaid: Callable[..., Any]):
    assert WHY in json.loads(one_level["gains.json"].read_text())["unidentified"]
    out = ["-o", tmp_path / "r.h5", "--duration", "9", "--scenario", "steps", "--json"]
    ran = run_eaid("simulate", one_level["fit.json"], "--gains", one_level["gains.json"], *out)
    said = json.loads(ran.out)["unidentified"]
    assert ran.code == 0 and WHY in said["gains"] and "one level only" in said["plant"]
    assert "warning: the gains were made from a fit that is not identifiable (one level only" in ran.err
    assert "it is marked" in ran.err


@pytest.mark.parametrize(("name", "mark"), [("gains.json", GAINS), ("steps.h5", GAINS), ("inverse.h5", PLANT)])
def test_either_file_alone_marks_the_page(name: str, mark: str, one_level: dict[str, Path], report: Callable[..., Any]):
    page = report(one_level[name], "--figures", "own_reference")
    (note,) = page.of("p", "mark")
    assert "".join(note.itertext()).startswith(f"{mark}; ") and (mark == PLANT or WHY in "".join(note.itertext()))


@pytest.mark.slow
def test_sound_results_have_no_mark(whole: Any):
    assert GAINS not in whole.html and 'class="mark"' not in whole.html and "@top-left" not in whole.html


@pytest.mark.slow
def test_every_section_and_every_figure_of_the_fit_is_marked(marked: Any):
    assert marked.html.count(f'<p class="running">{GAINS}</p>') == len(marked.of("section"))
    figures = {"input_gain": True, "fig11_steps": True, "fig07_nonlinear_model": True, "fig02_pwm": False}
    for name, has_mark in figures.items():
        picture = Image.open(marked.path.parent / f"figures/{name}.png").convert("RGB")
        strip = np.asarray(picture).astype(int)[: int(0.18 * 300)]
        red = (strip[..., 0] > 180) & (strip[..., 1] < 130) & (strip[..., 2] < 60)
        assert (red.sum() > 1000) == has_mark, name


@pytest.mark.slow
def test_it_stands_on_every_screen_and_every_printed_page(browser: Any, marked: Any, printed: Any, tmp_path: Path):
    tab = browser.new_context(viewport={"width": 380, "height": 800}).new_page()
    tab.goto(marked.path.as_uri())
    tab.locator("html[data-ready=true]").wait_for(state="attached", timeout=60_000)
    tab.evaluate("window.scrollTo(0, document.body.scrollHeight / 2)")
    tab.wait_for_timeout(800)
    box = tab.locator(".mark").bounding_box()
    assert box["y"] == pytest.approx(0, abs=1) and box["height"] < 80
    assert tab.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    tab.emulate_media(media="print")
    running = "[...document.querySelectorAll('.running')].filter(one => !one.closest('#appendix'))"
    assert tab.evaluate(f"{running}.every(one => one.checkVisibility())")
    pages = printed(tab, tmp_path)
    assert len(pages) != 1 and all(GAINS in one for one in pages)
    tab.context.close()
