"""A fit that must not be used leaves its mark: gains.json, replay.h5, every page and every figure of them."""

import json

import msgspec
import numpy as np
import pytest
from PIL import Image

import eaid

MARK = "Fit NOT USABLE: do not quote"
WHY = "the linear fit did not converge"


@pytest.fixture(scope="module")
def shaky(tmp_path_factory):
    """Data, a fit whose linear model did not converge, and gains and replays that were made of it all the same."""
    folder = tmp_path_factory.mktemp("shaky")
    made = {name: folder / name for name in ("data.h5", "fit.json", "gains.json", "steps.h5", "inverse.h5")}
    steps = eaid.synth(levels=(50.0,), repeats=3, hold_s=5.0, idle_s=1.0, rate_hz=100.0)
    fit = eaid.fit(steps)
    assert fit.verdict.usable and eaid.tune_rc(fit).not_usable is None  # one level is a warning
    solver = msgspec.structs.replace(fit.linear.solver, converged=False)
    fit = msgspec.structs.replace(fit, linear=msgspec.structs.replace(fit.linear, solver=solver))
    assert fit.summary().startswith(f"NOT USABLE: {WHY}") and fit.verdict.of("nonlinear").usable
    with pytest.raises(eaid.DataError, match=WHY):
        eaid.tune_rc(fit)
    gains = eaid.tune_rc(fit, anyway=True)
    replay = eaid.simulate(fit, gains, "steps", duration=9.0)
    inverse = eaid.simulate(fit, None, "steps", controller=("inverse",), duration=9.0)
    results = (steps, fit, gains, replay, inverse)
    for name, result in zip(made, results, strict=True):
        result.save(made[name])
    return made


@pytest.fixture(scope="module")
def marked(shaky, report):
    return report(*(path for name, path in shaky.items() if name != "inverse.h5"))


@pytest.mark.slow
def test_gains_and_replays_carry_it_on(shaky, tmp_path, run_eaid):
    assert WHY in json.loads(shaky["gains.json"].read_text())["not_usable"]
    out = ["-o", tmp_path / "r.h5", "--duration", "9", "--scenario", "steps", "--json"]
    ran = run_eaid("simulate", shaky["fit.json"], "--gains", shaky["gains.json"], *out)
    said = json.loads(ran.out)["not_usable"]
    assert ran.code == 0 and set(said) == {"gains"} and WHY in said["gains"]
    assert "warning: gains of a fit that is NOT USABLE (the linear fit" in ran.err


@pytest.mark.parametrize("name", ["fit.json", "gains.json", "steps.h5"])
def test_either_file_alone_marks_the_page(name, shaky, report):
    page = report(shaky[name], "--figures", "own_reference")
    (note,) = page.of("p", "mark")
    assert "".join(note.itertext()).startswith(f"{MARK}; {WHY}")
    assert not report(shaky["inverse.h5"], "--figures", "own_reference").of("p", "mark")  # its plant is sound


@pytest.mark.slow
def test_sound_results_have_no_mark(whole):
    assert MARK not in whole.html and 'class="mark"' not in whole.html and "@top-left" not in whole.html


@pytest.mark.slow
def test_every_section_and_every_figure_of_the_fit_is_marked(marked):
    assert marked.html.count(f'<p class="running">{MARK}</p>') == len(marked.of("section"))
    figures = {"fig09_shear_per_field": True, "fig11_steps": True, "fig07_nonlinear_model": True, "fig02_pwm": False}
    for name, has_mark in figures.items():
        picture = Image.open(marked.path.parent / f"figures/{name}.png").convert("RGB")
        strip = np.asarray(picture).astype(int)[-int(0.2 * 300) :]
        red = (strip[..., 0] > 180) & (strip[..., 1] < 130) & (strip[..., 2] < 60)
        assert (red.sum() > 1000) == has_mark, name


@pytest.mark.slow
def test_it_stands_on_every_screen_and_every_printed_page(browser, marked, printed, tmp_path):
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
    assert len(pages) != 1 and all(MARK in one for one in pages)
    tab.context.close()
