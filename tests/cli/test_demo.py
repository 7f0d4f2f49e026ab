"""The demo: every file there, the page named at the end, and a failing line that ends it."""

import json
import re
from pathlib import Path

import pytest

from eaid import EaidError
from eaid.cli import demo as demo_lines


def test_it_ends_by_naming_the_page(tmp_path, monkeypatch, run_eaid):
    ran = []
    monkeypatch.setattr(demo_lines, "run_line", lambda line, _folder: ran.append(line[0]))
    monkeypatch.chdir(tmp_path)
    shown = run_eaid("demo")
    assert shown.code == 0
    assert shown.err.splitlines()[-1] == f"demo/report.html: {len(ran)} commands; next: open it in a browser"
    assert ran[-1] == "report" and set(ran) == {"ingest", "fit", "tune-rc", "simulate", "plan", "report"}


def test_a_failing_command_ends_the_demo_with_its_line(tmp_path, capsys):
    with pytest.raises(EaidError, match=r"the demo stopped at: eaid fit gone\.h5 \(exit code 3\)") as stopped:
        demo_lines.run_line(("fit", "gone.h5"), tmp_path)
    assert stopped.value.exit_code == 3 and "gone.h5" in capsys.readouterr().err


@pytest.mark.slow
def test_the_whole_demo(tmp_path, run_eaid):
    made = tmp_path / "demo"
    ran = run_eaid("demo -o", made)
    names = {path.name for path in made.iterdir()}
    assert ran.code == 0 and names >= {*demo_lines.REPORTED, "plan.csv", "report.html", "figures"}
    assert len(list((made / "figures").glob("*.png"))) >= 14 and not [name for name in names if name.endswith(".part")]
    page = (made / "report.html").read_text(encoding="utf-8")
    assert (made / "report.html").stat().st_size < 8e6 and "(synthetic data)</title>" in page
    assert all(f"<h3>Table {n}</h3>" in page for n in ("I", "II", "III", "IV"))
    for path in [*made.glob("*.json"), *made.glob("*.html")]:  # no file names the machine
        text = re.sub(r"data:image/png;base64,[\w+/=]+", "", path.read_text(encoding="utf-8"))
        text = re.sub(r"<code.*?</button>", "", text)  # commands to copy work in any folder
        assert str(made) not in text and "site-packages" not in text
    fit, gains = (json.loads((made / name).read_text(encoding="utf-8")) for name in ("fit.json", "gains.json"))
    assert fit["converged"] and fit["data"]["kind"] == "clutch"
    kept = Path(__file__).parents[2] / "reports" / "demo"  # `make reports` writes it
    assert {path.name for path in kept.rglob("*")} == {path.name for path in made.rglob("*") if path.suffix != ".h5"}
    before = json.loads((kept / "gains.json").read_text(encoding="utf-8"))["margins"]["worst"]["rc"]
    assert before["gain_db"] == pytest.approx(gains["margins"]["worst"]["rc"]["gain_db"], rel=1e-6)
    assert gains["rc"]["K_P"] == 4.5 and gains["pi"]["settling_s"] == pytest.approx(0.27)
