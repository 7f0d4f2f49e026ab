"""`eaid report`: the page, its figures and what they are named."""

import json
from pathlib import Path

import pytest

LEVELS = [
    {"level": u, "Ts": 0.015 * u, "tau1": 0.3, "tau2": 4.0, "rmse": 0.01, "ci95": {}} for u in (17.0, 85.0, 170.0)
]
TREND = {"form": "linear", "over": "stress_kpa", "coefficients": [0.0944, -0.0896], "rmse": 0.01}
FIT = {
    "schema": "eaid/fit/2",
    "data": {"kind": "friction-force", "sources": []},
    "friction": {"C": 0.85, "levels": LEVELS, "trends": {"Ts": TREND}},
}


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("fit.json").write_text(json.dumps(FIT))


def test_page_and_figures_are_written_and_named(run_eaid):
    ran = run_eaid("report fit.json -o deep/report")
    assert (ran.code, ran.out) == (0, "")
    assert "deep/report/report.html: 1 figure; next: open it in a browser" in ran.err
    made = sorted(path.name for path in Path("deep/report").rglob("*") if path.is_file())
    assert made == ["fig04_friction_over_stress.png", "report.html"]
    Path("deep/report/report.html").write_text("mine")
    ran = run_eaid("report fit.json -o deep/report")
    wanted = "deep/report/report.html: exists already; give --force to overwrite the report, or another --output"
    assert ran.code == 2 and f"error: {wanted}\n" in ran.err and Path("deep/report/report.html").read_text() == "mine"


def test_figures_for_papers_hold_their_fonts_and_json_lists_what_was_made(run_eaid):
    ran = run_eaid("report fit.json -o r --json -q --format pdf,svg")
    told = json.loads(ran.out)
    assert told["figures"] == ["fig04_friction_over_stress"] and ran.err == ""
    figure = Path("r/figures/fig04_friction_over_stress")
    pdf, svg = figure.with_suffix(".pdf").read_bytes(), figure.with_suffix(".svg").read_text(encoding="utf-8")
    assert b"/FontFile2" in pdf and b"/Type3" not in pdf and b"CreationDate" not in pdf
    assert "<text" not in svg and "<dc:date>" not in svg  # letters are outlines: the same look without the font
    png = figure.with_suffix(".png").read_bytes()
    at = png.index(b"pHYs")
    assert int.from_bytes(png[at + 4 : at + 8]) == 11811  # pixels per metre: 300 dpi
    assert int.from_bytes(png[16:20]) == 2148  # 7.16 in


def test_the_logs_behind_a_fit_are_drawn_where_they_still_are_what_they_were(run_eaid):
    assert run_eaid("synth --levels 20,40,60,80,100 --hold 15 --idle 2 --release 0 --rate-hz 20 -q -o logs").code == 0
    assert run_eaid("fit logs --model nonlinear -q --force").code == 0
    drawn = "report fit.json --figures fig07 -q --force"
    assert run_eaid(drawn).code == 0 and Path("report/figures/fig07_nonlinear_model.png").is_file()
    log = next(Path("logs").glob("*.csv"))
    log.write_text(log.read_text() + "\n")
    assert run_eaid(f"{drawn} -o changed").code == 0 and not list(Path("changed").rglob("fig07*"))
