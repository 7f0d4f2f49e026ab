import json
import re
from html.parser import HTMLParser
from pathlib import Path

import html5lib
import pytest

from eaid.cli.main import run
from eaid.report.live import plain, script_safe
from eaid.report.page.render import signs
from eaid.report.tables.table import Name

FIGURES = (
    "fig02_pwm",
    "fig03_friction_steps",
    "fig04_friction_over_stress",
    "fig05_friction_over_speed",
    "fig06_hold_and_release",
    "fig07_nonlinear_model",
    "fig08_linear_model",
    "fig09_shear_per_field",
    "fig11_steps",
    "fig12_multisine",
    "fig13_sweep",
    "fig16_rehab",
    "fig17_rehab_errors",
)
"""The names that the contract lists."""


class Outline(HTMLParser):
    """Tags, ids and visible text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self._inside: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag in ("script", "style", "title"):
            self._inside.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if self._inside and self._inside[-1] == tag:
            self._inside.pop()

    def handle_data(self, data: str) -> None:
        if not self._inside:
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))

    def of(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def outline(text: str) -> Outline:
    return Outline(text)


def strict(text: str) -> None:
    """Raises where the page breaks the HTML standard's grammar."""
    html5lib.HTMLParser(strict=True).parse(text)


def test_the_checker_finds_what_is_wrong():
    with pytest.raises(html5lib.html5parser.ParseError):
        strict("<!DOCTYPE html><title>x</title><p></b><table><p></table>")


def test_the_page_is_valid_small_and_whole(page: Path, text: str, outline: Outline):
    strict(text)
    assert page.stat().st_size < 4e6
    ids = [attributes["id"] for _, attributes in outline.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert {link["href"] for link in outline.of("a")} <= {f"#{name}" for name in ids}


def test_nothing_outside_is_named(outline: Outline):
    for tag, attributes in outline.tags:
        for key in ("src", "href", "srcset", "data", "action", "poster"):
            value = attributes.get(key) or ""
            assert value.startswith(("data:", "#")) or not value, (tag, value)
    (policy,) = [meta["content"] or "" for meta in outline.of("meta") if meta.get("http-equiv")]
    assert policy.startswith("default-src 'none'") and "unsafe-inline' ; script" not in policy
    assert re.search(r"script-src 'sha256-\S+' 'sha256-\S+';", policy)


def test_every_figure_of_the_contract_is_there_with_its_words(page: Path, outline: Outline):
    shown = [figure["id"] for figure in outline.of("figure") if "id" in figure]
    assert [name for name in shown if name in FIGURES] == sorted(
        (name for name in FIGURES), key=lambda name: shown.index(name)
    )
    assert set(FIGURES) <= set(shown)
    for name in shown:
        assert (page.parent / "figures" / f"{name}.png").is_file()
    for image in outline.of("img"):
        assert len(image["alt"] or "") > 40 and image["width"] and image["height"]


def test_tables_one_to_four_stand_beside_the_published_values(outline: Outline, text: str):
    headings = re.findall(r"<h3>(Table [IV]+)</h3>", text)
    assert sorted(headings) == ["Table I", "Table II", "Table III", "Table IV"]
    for value in ("0.0944 σ − 0.0896", "0.00674", "12.4", "1.36"):
        assert value in outline.text


PARTS = ["summary", "data", "model", "controller", "replay", "rehabilitation", "appendix"]


def test_the_parts_stand_in_their_order_and_in_the_navigation(text: str, outline: Outline):
    assert re.findall(r'<section id="(\w+)">', text) == PARTS
    assert [link["href"] for link in outline.of("a")][1:8] == [f"#{name}" for name in PARTS]


def test_each_part_has_its_picture_first_and_counts_what_it_folds(text: str):
    for name in PARTS[1:-1]:
        part = text.split(f'<section id="{name}">')[1].split("</section>")[0]
        assert part.index("<figure") < part.index("<table"), name
        shown = re.sub(r"<details.*?</details>", "", part, flags=re.DOTALL)
        assert shown.count("<table>") <= 1, name
    for fold in re.findall(r"<details.*?</details>", text, re.DOTALL):
        count = re.search(r'class="count">(?:(\d+) figures?)?(?: and )?(?:(\d+) tables?)?', fold)
        if count is None or not any(count.groups()):
            continue
        figures, tables = (int(n or 0) for n in count.groups())
        assert (figures, tables) == (fold.count("<figure"), fold.count("<table>"))


def test_synthetic_data_say_so_in_the_title(text: str, outline: Outline):
    assert re.search(r"<title>[^<]*\(synthetic data\)</title>", text)
    assert "No rig recorded them" in outline.text


def test_files_are_named_with_their_fingerprint(files: dict[str, Path], outline: Outline):
    import hashlib

    for path in files.values():
        assert hashlib.sha256(path.read_bytes()).hexdigest() in outline.text


@pytest.mark.slow
def test_the_same_files_give_the_same_bytes(files: dict[str, Path], page: Path, tmp_path: Path):
    assert run(["report", *map(str, files.values()), "-o", str(tmp_path / "again"), "-q"]) == 0
    assert (tmp_path / "again/report.html").read_bytes() == page.read_bytes()
    for name in ("one", "two"):
        fit = str(files["friction-force.json"])
        assert run(["report", fit, "-o", str(tmp_path / name), "-q", "--format", "pdf,svg"]) == 0
    made = sorted(path.name for path in (tmp_path / "one/figures").iterdir())
    assert [name for name in made if "fig04" in name] == [
        f"fig04_friction_over_stress.{kind}" for kind in ("pdf", "png", "svg")
    ]
    for name in made:
        assert (tmp_path / "one/figures" / name).read_bytes() == (tmp_path / "two/figures" / name).read_bytes(), name


def test_a_fit_alone_is_shown_and_the_rest_named_with_its_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Only what the contract asks tune-rc to need: every further key may be absent."""
    fit = {
        "schema": "eaid/fit/1",
        "linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"B_m": 12.4, "B_M": 42.6}},
    }
    (tmp_path / "fit.json").write_text(json.dumps(fit))
    assert run(["report", str(tmp_path / "fit.json"), "-o", str(tmp_path / "out")]) == 0
    outline = Outline((tmp_path / "out/report.html").read_text(encoding="utf-8"))
    assert "Linear model, Eq. (8)" in outline.text
    line = "Fig. 13 · Sines of rising frequency: eaid simulate fit.json --gains gains.json --scenario sweep"
    assert line in outline.text
    assert "figures want more results; the page's appendix names the commands" in capsys.readouterr().err


@pytest.mark.slow
def test_two_fits_of_one_kind_stand_side_by_side(files: dict[str, Path], tmp_path: Path):
    other = json.loads(files["clutch.json"].read_text(encoding="utf-8"))
    for row in other["friction"]["levels"]:
        row["Ts"] *= 1.5
        row["ci95"] = {"Ts": [1.5 * end for end in row["ci95"]["Ts"]]}
    (tmp_path / "after.json").write_text(json.dumps(other))
    arguments = ["report", str(files["clutch.json"]), str(tmp_path / "after.json"), "-o", str(tmp_path / "out"), "-q"]
    assert run(arguments) == 0
    text = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    strict(text)
    outline = Outline(text)
    assert "two fits side by side" in outline.text
    assert re.search(r"at 20 % \(N·m\) .{0,80}\+50\.0 % yes", outline.text)
    assert re.search(r"a0 \(1/s\) .{0,80}\+0\.0 % no", outline.text)
    assert "Their 95 % intervals part for T s at 20, 40, 60, 80 and 100 %: more than repeats explain." in outline.text
    assert "Single levels of both fits, 95 %" in outline.text and text.count('class="picture"') == 2
    part = text.split('<section id="model">')[1]
    assert part.index('id="compare"') < part.index("<h3>Both fits</h3>") < part.index("<details")
    assert f"Clutch, {tmp_path}/after.json" in outline.text
    assert (tmp_path / "out/figures/compare.png").is_file()


HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(2)>&\"'{{7*7}}"


@pytest.mark.slow
def test_data_alone_are_shown_once(files: dict[str, Path], tmp_path: Path):
    for given in ([files["clutch.h5"]], [files["clutch.h5"], files["clutch.json"]]):
        out = tmp_path / str(len(given))
        assert run(["report", *map(str, given), "-o", str(out), "-q"]) == 0
        strict(text := (out / "report.html").read_text(encoding="utf-8"))
        ids = re.findall(r' id="([^"]+)"', text)
        assert len(ids) == len(set(ids)) and "fig07_nonlinear_model" in ids


@pytest.mark.slow
def test_hostile_text_is_shown_and_never_run(files: dict[str, Path], tmp_path: Path):
    fit = json.loads(files["clutch.json"].read_text(encoding="utf-8"))
    fit["data"]["synthetic"] = HOSTILE
    fit["data"]["inputs"] = [{"path": HOSTILE, "sha256": HOSTILE}]
    fit["nonlinear"]["warnings"] = [HOSTILE]
    fit["data"]["input_unit"] = HOSTILE
    fit["data"]["sources"][0]["run"] = HOSTILE
    path = tmp_path / "fit <b>&'\" $(x).json"
    path.write_text(json.dumps(fit), encoding="utf-8")
    assert run(["report", str(path), str(files["clutch.h5"]), "-o", str(tmp_path / "out"), "-q"]) == 0
    text = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    strict(text)
    outline = Outline(text)
    assert HOSTILE in "".join(outline.words)
    assert not [image for image in outline.of("img") if image.get("src") == "x"]
    assert "alert(1)</script>" not in text and "onerror=alert(2)>" not in text
    assert "49" not in re.findall(r"'(\d+)'", text)
    assert "'\\''" in "".join(outline.words) or '"\'"' in "".join(outline.words)  # quoted for the shell, too


def test_scripts_hold_no_character_that_could_end_them():
    assert script_safe('{"a":"</script><!--&"}') == '{"a":"\\u003c/script\\u003e\\u003c!--\\u0026"}'


def test_tooltips_hold_no_html_and_no_columns():
    assert plain("<b>@x $y{0} &amp;") == "‹b›＠x ＄y(0) ＆amp;"


def test_formulas_are_set_after_everything_else_is_escaped():
    assert signs("T_s = a e^(−0.2 σ), u^2 <b>") == "T<sub>s</sub> = a e<sup>−0.2 σ</sup>, u<sup>2</sup> &lt;b&gt;"
    assert signs(Name("run_T_s^2")) == "run_T_s^2"  # a name is no formula


def luminance(colour: str) -> float:
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: str, other: str) -> float:
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def test_contrast_is_worked_out_right():
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("scheme", [0, 1])
def test_text_contrast_meets_wcag_aa(text: str, scheme: int):
    block = re.findall(r":root \{(.*?)\}", text, re.DOTALL)[scheme]
    colours = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", block))
    pairs = [(ink, "ground") for ink in ("ink", "soft", "link", "good", "care", "bad")]
    pairs += [("ink", f"{grade}-ground") for grade in ("good", "care", "bad")] + [("ink", "card")]
    for ink, ground in pairs:
        assert contrast(colours[ink], colours[ground]) >= 4.5, (ink, ground)


def test_words_are_explained_where_they_first_appear(text: str):
    told = re.findall(r"<dfn>(.*?)</dfn>", text)
    assert len(told) == len(set(told))
    for word, sign in (("RMSE", "RMSE"), ("RC, PI", "RC"), ("sd", "± sd"), ("dB", "dB"), ("margin", "margin")):
        assert word in told
        section = re.split(r"<section |<details", text.split(f"<dfn>{word}</dfn>")[0])[-1]
        before = text.split("<main>")[1].split(f"<dfn>{word}</dfn>")[0][: -len(section)]
        visible = re.sub(r"<script.*?</script>|<summary>.*?</summary>|<[^>]+>", " ", before, flags=re.DOTALL)
        assert not re.search(rf"\\b{re.escape(sign)}\\b", visible), word


def test_the_summary_says_what_the_files_say(files: dict[str, Path], outline: Outline):
    fit = json.loads(files["clutch.json"].read_text(encoding="utf-8"))
    top = fit["nonlinear"]["curves"][-1]  # of the estimate that is used, with its interval
    assert f"{top['Ts']:.2f} N·m" in outline.text and f"{top['tau1']:.3f} s" in outline.text
    gains = json.loads(files["gains.json"].read_text(encoding="utf-8"))
    worst = gains["margins"]["worst"]
    assert f"{worst['rc']['phase_deg']:.0f}° | {worst['pi']['phase_deg']:.0f}°" in outline.text
    assert "eaid plan" in outline.text and outline.text.count("Copy") <= 6
