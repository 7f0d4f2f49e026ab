import json
from pathlib import Path

import pytest

from eaid.cli.main import run

FIT = {
    "schema": "eaid/fit/1",
    "data": {"kind": "friction-force", "sources": []},
    "friction": {
        "C": 0.85,
        "levels": [
            {"level": float(u), "Ts": 0.015 * u, "tau1": 0.3, "tau2": 4.0, "rmse": 0.01, "ci95": {}}
            for u in (17, 85, 170)
        ],
        "trends": {"Ts": {"form": "linear", "over": "stress_kpa", "coefficients": [0.0944, -0.0896], "rmse": 0.01}},
    },
}


@pytest.fixture
def fit(tmp_path: Path) -> Path:
    path = tmp_path / "fit.json"
    path.write_text(json.dumps(FIT))
    return path


def test_page_and_figures_are_written_and_named(fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "deep/report"
    assert run(["report", str(fit), "-o", str(out)]) == 0
    said = capsys.readouterr()
    assert said.out == ""
    assert f"{out}/report.html: 1 figures" in said.err
    assert "figures want more results; the page's appendix names the commands" in said.err
    assert sorted(path.name for path in out.rglob("*") if path.is_file()) == [
        "fig04_friction_over_stress.png",
        "report.html",
    ]


def test_json_lists_what_was_made(fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert run(["report", str(fit), "-o", str(tmp_path / "r"), "--json", "-q"]) == 0
    said = capsys.readouterr()
    told = json.loads(said.out)
    assert told["figures"] == ["fig04_friction_over_stress"] and said.err == ""
    assert ["fig08_linear_model", "eaid fit clutch.h5 -o fit.json"] in told["missing"]


def test_an_earlier_page_is_left_alone(fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "report"
    assert run(["report", str(fit), "-o", str(out), "-q"]) == 0
    (out / "report.html").write_text("mine")
    assert run(["report", str(fit), "-o", str(out)]) == 2
    assert (
        f"error: {out}/report.html: exists already; give --force to overwrite the report, or another --output\n"
        in capsys.readouterr().err
    )
    assert (out / "report.html").read_text() == "mine"
    assert run(["report", str(fit), "-o", str(out), "-q", "--force"]) == 0
    assert (out / "report.html").read_text() != "mine"


def test_figures_for_papers_hold_their_fonts(fit: Path, tmp_path: Path):
    assert run(["report", str(fit), "-o", str(tmp_path / "r"), "-q", "--format", "pdf,svg"]) == 0
    figure = tmp_path / "r/figures/fig04_friction_over_stress"
    pdf = figure.with_suffix(".pdf").read_bytes()
    assert b"/FontFile2" in pdf and b"/Type3" not in pdf and b"CreationDate" not in pdf
    svg = figure.with_suffix(".svg").read_text(encoding="utf-8")
    assert "<text" not in svg and "<dc:date>" not in svg  # letters are outlines: the same look without the font
    png = figure.with_suffix(".png").read_bytes()
    at = png.index(b"pHYs")
    assert int.from_bytes(png[at + 4 : at + 8]) == 11811  # pixels per metre: 300 dpi
    assert int.from_bytes(png[16:20]) == 2148  # 7.16 in


def test_an_unknown_format_is_refused(fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert run(["report", str(fit), "-o", str(tmp_path / "r"), "--format", "jpg"]) == 2
    assert "error: --format jpg: must be one of pdf, svg, png; did you mean png?\n" in capsys.readouterr().err
    assert not (tmp_path / "r").exists()


def test_what_is_no_result_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "x.json").write_text("[]")
    assert run(["report", str(tmp_path / "x.json"), "-o", str(tmp_path / "r")]) == 3
    wanted = f"error: {tmp_path}/x.json: is no result of eaid; give a fit.json, gains.json, replay.h5 or data.h5\n"
    assert capsys.readouterr().err == wanted
    assert not (tmp_path / "r").exists()
