"""Files given to a report: told apart, checked, refused with all faults; a folder written whole or not at all."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest

import eaid

WANTED = {"a.json": "is not a JSON file", "b.json": "is no result of eaid", "c.txt": "is not a JSON file", "d.h5": "no"}


def names_in(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_everything_that_is_no_result_is_told_at_once(tmp_path, run_eaid):
    (tmp_path / "a.json").write_text("{")
    (tmp_path / "b.json").write_text(json.dumps({"schema": "other/1"}))
    (tmp_path / "c.txt").write_bytes(b"\xff\xfe\x00")
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["x"] = np.zeros(3)
    paths = [tmp_path / name for name in ("a.json", "b.json", "c.txt", "d.h5", "gone.json")]
    ran = run_eaid("report", *paths, "-o", tmp_path / "out")
    assert ran.code == 3 and not (tmp_path / "out").exists()
    assert all(f"{tmp_path / name}: {said}" in ran.err for name, said in WANTED.items())
    assert f"{paths[4]}: no such file" in ran.err
    ran = run_eaid("report", tmp_path, "-o", tmp_path / "out")
    assert ran.code == 2 and "is a folder; give the files in it" in ran.err
    with pytest.raises(eaid.UsageError, match="a dict is no result"):
        eaid.report([{}], tmp_path / "out")


def test_a_scripts_json_is_known_by_its_parts_and_replays_have_the_papers_order(files, tmp_path, report, replay_file):
    (tmp_path / "a.json").write_text(json.dumps({"linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42}}))
    (tmp_path / "b.json").write_text(json.dumps({"model": {"a0": 1.36, "b0": 0.08, "c0": -2.42}, "rc": None}))
    given = (files["multisine.h5"], tmp_path / "b.json", tmp_path / "a.json", files["steps.h5"])
    mine = replay_file(tmp_path / "mine.h5", {"rc": {}}, scenario="multisine")
    page = report(*given, mine, "--figures", "own_reference")
    kinds = {Path(row[0]).name: row[1] for row in page.rows("Files")}
    assert kinds == {"a.json": "fit, clutch", "b.json": "gains", "steps.h5": "replay, steps",
                     "multisine.h5": "replay, multisine", "mine.h5": "replay, multisine"}  # fmt: skip
    shown = [row[:2] for row in page.rows("Errors of each controller")]
    assert [row[0] for row in shown[:2]] == ["steps"] * 2 and [row[1] for row in shown[:2]] == ["RC", "PI"]


@pytest.mark.parametrize(
    ("head", "columns", "says"),
    [
        ({}, {"duty_pct": None}, "controller 'rc' has no duty_pct; make the replay again"),
        ({}, {"time_s": np.zeros(3)}, "rc: its time_s does not rise"),
        ({}, {"time_s": np.float64(1.0)}, "rc: its time_s is no column of two samples"),
        ({}, {"torque_nm": np.zeros(2)}, "controller 'rc' has no torque_nm"),
        ({}, {"torque_nm": np.full(3, np.nan)}, "rc: its torque_nm holds what is no number"),
        ({}, {"torque_nm": np.array([b"x"] * 3)}, "rc: its torque_nm holds what is no number"),
        ({}, {"metrics": {"steps": [3]}}, "rc: its steps[0] is 3"),
        ({}, {"metrics": {"max_abs_error_nm": np.nan}}, "its metrics is no JSON"),
        ({"scenario": 3}, {}, "its scenario is 3"),
        ({"dt_s": -1.0}, {}, "its dt_s is -1.0"),
        ({"anything": "{"}, {}, "its anything is no JSON"),
    ],
)
def test_what_a_replay_holds_is_checked(tmp_path, head, columns, says, run_eaid, replay_file):
    path = replay_file(tmp_path / "replay.h5", {"rc": {}}, columns, **head)
    ran = run_eaid("report", path, "-o", tmp_path / "out")
    assert ran.code == 3 and says in ran.err and not (tmp_path / "out").exists()


def test_figures_for_papers_hold_their_fonts_and_what_was_made_is_named(files, tmp_path, run_eaid):
    out, figure = tmp_path / "deep/report", tmp_path / "deep/report/figures/fig04_friction_over_stress"
    words = ["report", files["friction-force.json"], "-o", out, "--figures", "fig04", "--format", "pdf,svg"]
    ran = run_eaid(*words, "--json")
    assert json.loads(ran.out)["figures"] == [figure.name]
    assert ran.err.endswith(f"{out}/report.html: 1 figure; next: open it in a browser\n")
    assert names_in(out) == [*(f"figures/{figure.name}.{kind}" for kind in ("pdf", "png", "svg")), "report.html"]
    pdf, svg = figure.with_suffix(".pdf").read_bytes(), figure.with_suffix(".svg").read_text(encoding="utf-8")
    assert b"/FontFile2" in pdf and b"/Type3" not in pdf and b"CreationDate" not in pdf
    assert "<text" not in svg and "<dc:date>" not in svg  # letters are outlines: the same look without the font
    png = figure.with_suffix(".png").read_bytes()
    at = png.index(b"pHYs")
    assert int.from_bytes(png[at + 4 : at + 8]) == 11811  # pixels per metre: 300 dpi
    assert int.from_bytes(png[16:20]) == 2148  # 7.16 in
    told = "exists already; give --force to overwrite the report, or another --output\n"
    assert run_eaid(*words).err == f"error: {out}/report.html: {told}"


def test_the_logs_behind_a_fit_are_drawn_where_they_still_are_what_they_were(tmp_path, run_eaid, report):
    logs, fit = tmp_path / "logs", tmp_path / "fit.json"
    assert run_eaid("synth", "--levels", "20,60", "--hold", "15", "--rate-hz", "20", "-q", "-o", logs).code == 0
    assert run_eaid("fit", logs, "--model", "friction", "--ci", "none", "-q", "-o", fit).code == 0
    drawn = report(fit, "--figures", "fig07").path.parent / "figures/fig07_nonlinear_model.png"
    log = next(logs.glob("*.csv"))
    log.write_text(log.read_text() + "\n")
    changed = report(fit, "--figures", "fig07").path.parent / "figures/fig07_nonlinear_model.png"
    assert drawn.is_file() and not changed.exists()


@pytest.mark.slow
@pytest.mark.parametrize("held", ["report.html", "figures/model_over_duty.png", "figures/fig07_nonlinear_model.svg"])
def test_without_force_nothing_is_written_over(files, tmp_path, held, run_eaid):
    (tmp_path / "out" / held).parent.mkdir(parents=True)
    (tmp_path / "out" / held).write_text("mine")
    arguments = ["report", files["clutch.json"], "-o", tmp_path / "out", "--figures", "model_over_duty", "-q"]
    assert run_eaid(*arguments).code == 2
    assert names_in(tmp_path / "out") == [held] and (tmp_path / "out" / held).read_text() == "mine"
    (tmp_path / "out/figures").mkdir(exist_ok=True)
    (tmp_path / "out/figures/notes.txt").write_text("mine too")
    assert run_eaid(*arguments, "--force").code == 0
    # Old figures of a report go with the old page; what is not of a report stays.
    assert names_in(tmp_path / "out") == ["figures/model_over_duty.png", "figures/notes.txt", "report.html"]


@pytest.mark.slow
def test_three_threads_write_the_same_bytes(files, tmp_path):
    results = [eaid.load(files[name]) for name in ("clutch.h5", "clutch.json", "steps.h5")]
    figures = ("fig07", "fig11")
    with ThreadPoolExecutor(3) as pool:
        pages = list(pool.map(lambda k: eaid.report(results, tmp_path / f"{k}", figures=figures), range(3)))
    written = [{path.name: path.read_bytes() for path in page.parent.rglob("*.*")} for page in pages]
    assert len(written[0]) == 3 and written[0] == written[1] == written[2]
