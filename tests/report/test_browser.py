"""The page in a real browser: every plot drawn, no error, no request; light and dark, narrow, printed, scripts off."""

import io
import re

import numpy as np
import pytest
from PIL import Image

pytestmark = pytest.mark.slow

PLOTS = {"fig07_nonlinear_model", "fig03_friction_steps", "fig12_multisine", "fig11_steps", "fig16_rehab"}
WALK = """const every = node => [...node.querySelectorAll('*')].flatMap(
  one => [one, ...(one.shadowRoot ? every(one.shadowRoot) : [])]);"""
"""All elements below a node, those inside shadow roots too."""
PAINTED = f"""() => {{ {WALK}
  const colours = canvas => {{
    const pixels = new Uint32Array(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.buffer);
    return new Set(pixels).size; }};
  return [...document.querySelectorAll('.has-live')].map(figure => [figure.id, Math.max(0, ...every(figure).filter(
    one => one.tagName === 'CANVAS' && one.width * one.height > 0).map(colours))]); }}"""
"""Colours on each live plot's busiest canvas: an empty plot has a handful, a drawn one many."""
OPEN = """() => { for (const fold of document.querySelectorAll('details')) fold.open = true;
  return document.querySelectorAll('details:not([open])').length; }"""
"""Unfold everything."""
TOOLTIP = f"""() => {{ {WALK}
  return every(document).filter(one => one.matches('.bk-Tooltip') && one.shadowRoot).map(
    one => one.shadowRoot.textContent).join(' '); }}"""
"""Text of the tooltips that are shown."""


def opened(browser, page, **options):
    """The page in a tab of its own, with what it complained of and what it asked for."""
    context = browser.new_context(**options)
    context.set_offline(True)
    tab = context.new_page()
    faults = []
    requests = []
    tab.on("console", lambda said: faults.append(said.text) if said.type in ("error", "warning") else None)
    tab.on("pageerror", lambda fault: faults.append(str(fault)))
    tab.on("request", lambda request: requests.append(request.url))
    tab.goto(page.as_uri())
    if options.get("java_script_enabled", True):
        tab.locator("html[data-ready=true]").wait_for(state="attached", timeout=60_000)
    return tab, faults, requests


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 380])
def test_every_figure_is_drawn_without_error_or_request(browser, page, width, scheme):
    tab, faults, requests = opened(browser, page, viewport={"width": width, "height": 900}, color_scheme=scheme)
    assert faults == []
    assert [url for url in requests if not url.startswith(("data:", page.as_uri()))] == []
    assert tab.evaluate(OPEN) == 0
    tab.wait_for_timeout(1500)
    painted = dict(tab.evaluate(PAINTED))
    assert set(painted) == PLOTS
    assert min(painted.values()) > 20, painted
    assert tab.evaluate("[...document.images].every(image => image.complete && image.naturalWidth > 0)")
    assert tab.evaluate("document.documentElement.scrollWidth <= window.innerWidth")  # nothing hangs over the edge
    assert tab.evaluate("(bar => bar.scrollWidth <= bar.clientWidth)(document.querySelector('nav ul'))")
    for drawn in ("#fig12_multisine-live", "#residuals img", ".picture img >> nth=0"):
        picture = Image.open(io.BytesIO(tab.locator(drawn).screenshot())).convert("L")
        assert (np.argmax(picture.histogram()) > 128) == (scheme == "light"), drawn  # its ground
    tab.context.close()


def test_a_pointer_zooms_reads_a_value_off_and_copies_and_a_finger_scrolls(browser, page):
    zooming = "Bokeh.documents[0].roots()[0].toolbar.tools.find(tool => tool.type === 'BoxZoomTool').active"
    tab, faults, _requests = opened(browser, page, viewport={"width": 1280, "height": 900})
    assert tab.evaluate(zooming) is True
    tab.context.grant_permissions(["clipboard-read", "clipboard-write"])
    tab.locator("button.copy").first.click()
    tab.wait_for_timeout(300)
    assert tab.locator("button.copy").first.inner_text() == "Copied" and faults == []
    copied = tab.evaluate("navigator.clipboard.readText()")
    assert copied == tab.locator(".next code").first.inner_text() and copied.startswith("eaid ")
    plot = tab.locator("#fig12_multisine-live")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    for share in range(10, 90, 2):  # down through the torque panel until the pointer meets a curve
        tab.mouse.move(box["x"] + box["width"] * 0.5, box["y"] + 300 * share / 100)
        tab.wait_for_timeout(40)
        if "time" in (shown := tab.evaluate(TOOLTIP)):
            break
    assert re.search(r"(RC|PI|reference)", shown) and re.search(r"\d\.\d{3} s", shown) and "N·m" in shown, shown
    values = set()
    for step in range(60):  # through the errors, which go below zero
        tab.mouse.move(box["x"] + box["width"] * (0.2 + 0.01 * step), box["y"] + box["height"] * (0.6 + 0.005 * step))
        tab.wait_for_timeout(20)
        values |= set(re.findall(r"value: (\S+)", tab.evaluate(TOOLTIP)))
    assert any(value.startswith("−0.") for value in values) and not any("-" in value for value in values)
    tab.context.close()
    phone = {"viewport": {"width": 380, "height": 800}, "has_touch": True, "is_mobile": True}
    tab, faults, _requests = opened(browser, page, **phone)
    assert tab.evaluate(zooming) is False and faults == []
    tab.context.close()


def test_without_scripts_and_on_paper_the_static_figures_stand_in(browser, page):
    still = "[...document.querySelectorAll('.has-live')].filter(one => !one.closest('details'))"
    visible = f"{still}.filter(one => one.querySelector('img').checkVisibility()).length"
    tab, _faults, _requests = opened(browser, page, java_script_enabled=False)
    images = tab.locator("section > .has-live img")
    assert images.count() == 3 and all(images.nth(i).is_visible() for i in range(3))
    tab.context.close()
    tab, _faults, _requests = opened(browser, page)
    assert tab.evaluate(visible) == 0
    tab.emulate_media(media="print")
    assert tab.evaluate(visible) == 3
    tab.context.close()


def wrong_for_assistive_technology(browser, page, scheme, width):
    """Rules of axe that the unfolded page breaks, and where."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is not installed")
    # bypass_csp only lets the checker itself in; the page's policy is tested above.
    context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme, bypass_csp=True)
    tab = context.new_page()
    tab.goto(page.as_uri())
    tab.locator("html[data-ready=true]").wait_for(state="attached", timeout=60_000)
    tab.evaluate(OPEN)
    tab.wait_for_timeout(1500)
    found = axe.Axe().run(tab).response["violations"]
    context.close()
    return [(rule["id"], [node["target"] for node in rule["nodes"]]) for rule in found]


@pytest.fixture(scope="module")
def other_pages(others, long, report):
    return {name: report(*given).path for name, given in {**others, "long": long}.items()}


TABLES = "[...document.querySelectorAll('table')].filter(one => one.checkVisibility()).length"
"""Tables that are shown."""
BOTTOM = "one => document.querySelector(one).getBoundingClientRect().bottom"
"""Where an element ends on the first screen."""


@pytest.mark.parametrize(("width", "height", "tallest"), [(1280, 900, 12_000), (380, 800, 18_000)])
@pytest.mark.parametrize("name", ["all", "recorded", "staircase", "long"])
def test_every_page_is_short_answers_first_and_serves_assistive_technology(
    browser, page, other_pages, name, width, height, tallest, printed, tmp_path
):
    shown, wide = (page if name == "all" else other_pages[name]), width == 1280
    assert shown.stat().st_size < 4e6
    tab, faults, _requests = opened(browser, shown, viewport={"width": width, "height": height})
    assert tab.evaluate("document.documentElement.scrollHeight") <= tallest
    assert tab.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    assert tab.evaluate(TABLES) <= 10
    for part in ("h1", ".chips", ".lights", ".picture", *((".numbers", ".next") if wide else ())):
        assert tab.evaluate(BOTTOM, part) <= height, part
    assert len(tab.query_selector_all(".lights a")) == 3 and len(tab.query_selector_all(".next li")) <= 3
    assert len(tab.query_selector_all(".numbers table")) == {"all": 2, "long": 2}.get(name, 1)
    one_level = name == "staircase"  # its steps end at one level: nothing lies over the input
    assert len(tab.query_selector_all(".pictures img")) == 2 - one_level
    heights = tab.evaluate("[...document.querySelectorAll('.lights a')].map(one => one.getBoundingClientRect().height)")
    assert max(heights) < (80 if wide else 200)
    tab.evaluate("window.scrollTo(0, 3000)")
    tab.wait_for_timeout(900)
    assert tab.evaluate("document.querySelector('.top').getBoundingClientRect().top") == pytest.approx(0, abs=1)
    if wide:
        assert len(printed(tab, tmp_path)) <= 8
    assert faults == []
    tab.context.close()
    assert wrong_for_assistive_technology(browser, shown, "light" if wide else "dark", width) == []


def test_print_is_summary_and_figures_on_eight_pages(browser, page, printed, tmp_path):
    tab, _faults, _requests = opened(browser, page)
    tab.emulate_media(media="print")
    assert tab.evaluate("getComputedStyle(document.querySelector('.lights .care')).backgroundColor") != "rgb(0, 0, 0)"
    assert tab.evaluate("getComputedStyle(document.querySelector('img')).filter") == "none"
    pages = printed(tab, tmp_path)
    titles = tab.evaluate("[...document.querySelectorAll('.figure figcaption b')].map(one => one.textContent)")
    heads = tab.evaluate("[...document.querySelectorAll('h1, h2, h3')].map(one => one.textContent)")
    tab.context.close()
    assert len(pages) <= 8
    told = re.sub(r"\s+", " ", " ".join(pages))
    assert not pages or [title for title in titles if title not in told] == []
    for one in pages:
        last = [line.strip() for line in one.splitlines() if line.strip()][-1]
        assert last not in heads
