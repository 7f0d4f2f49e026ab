"""`eaid synth` through its runner: exit codes, files, sentences."""

import json
from pathlib import Path

import numpy as np
import pytest

from eaid.cli import main
from eaid.logs.dataset import read_dataset

QUICK = ["--levels", "40,90", "--repeats", "2", "--hold", "2", "--idle", "1", "--release", "1", "--rate-hz", "100"]


def test_a_dataset_its_summary_and_the_same_bytes_twice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, again, other = (tmp_path / name for name in ("a.h5", "b.h5", "c.h5"))
    assert main.run(["synth", *QUICK, "-o", str(first), "--json"]) == 0
    told = capsys.readouterr()
    summary = json.loads(told.out)
    assert (
        told.err
        == f"{first}: 4 synthetic runs of the reference plant (docs/synthetic.md), seed 0; next: eaid fit {first}\n"
    )
    assert summary["schema"] == "eaid/synth/1" and summary["kind"] == "clutch" and summary["seed"] == 0
    assert [row["level"] for row in summary["runs"]] == [40, 40, 90, 90] and summary["runs"][0]["samples"] == 400
    assert main.run(["synth", *QUICK, "-o", str(again), "-q"]) == 0
    assert main.run(["synth", *QUICK, "-o", str(other), "-q", "--seed", "1"]) == 0
    assert first.read_bytes() == again.read_bytes() != other.read_bytes()
    runs, faults = read_dataset(first, "a.h5", "")
    assert not faults and [run.level for run in runs] == [40, 40, 40, 40, 90, 90, 90, 90]
    assert [run.edge for run in runs[:2]] == ["rising", "falling"] and runs[0].step_s == 1.0 and runs[1].step_s == 3.0
    assert all(run.synthetic and "recorded on no rig" in run.synthetic for run in runs)


def test_a_folder_of_csv_holds_the_same_numbers_as_the_dataset(tmp_path: Path) -> None:
    assert main.run(["synth", *QUICK, "-o", str(tmp_path / "d.h5"), "-q"]) == 0
    assert main.run(["synth", *QUICK, "-o", str(tmp_path / "logs"), "-q"]) == 0
    runs, _ = read_dataset(tmp_path / "d.h5", "d.h5", "")
    assert len(runs) == 8
    for rising, falling in zip(runs[::2], runs[1::2], strict=True):
        rows = np.loadtxt(tmp_path / "logs" / f"{rising.name}.csv", delimiter=",", skiprows=2)
        both = [
            np.concatenate(pair)
            for pair in zip(*([r.time_s, r.input, r.output] for r in (rising, falling)), strict=True)
        ]
        np.testing.assert_array_equal(rows.T, both)


def test_the_default_name_says_synthetic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main.run(["synth", *QUICK, "-q"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["synthetic.h5"]


def test_an_earlier_result_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "d.h5"
    path.write_text("mine")
    assert main.run(["synth", *QUICK, "-o", str(path)]) == 2
    assert path.read_text() == "mine" and "give --force" in capsys.readouterr().err
    assert main.run(["synth", *QUICK, "-o", str(path), "--force", "-q"]) == 0
    assert path.read_bytes()[1:4] == b"HDF"


def test_from_a_fit_and_along_a_duty_file(tmp_path: Path) -> None:
    fit, duty, out = tmp_path / "fit.json", tmp_path / "duty.csv", tmp_path / "d.h5"
    model = {"C": 0.85, "tau1": [0.1, 0, 0], "tau2": [2.0, 0, 0], "Ts": [0, 0.04, 0, 0], "u_range": [10, 100]}
    fit.write_text(json.dumps({"schema": "eaid/fit/1", "nonlinear": model}))
    duty.write_text("time_s,duty_pct\n0,0\n1,50\n41,0\n42,0\n")
    call = ["synth", "--plant", str(fit), "--duty-file", str(duty), "--clean", "--repeats", "1", "--rate-hz", "100"]
    assert main.run([*call, "-o", str(tmp_path / "logs"), "-q"]) == 0
    (file,) = (tmp_path / "logs").iterdir()
    _, duty_pct, torque_nm = np.loadtxt(file, delimiter=",", skiprows=2).T
    assert duty_pct[100] == 50 and duty_pct[99] == 0
    assert torque_nm[4099] == pytest.approx(2.0, abs=1e-6)  # 0.04 N·m/% · 50 %, settled
    assert "fit.json" in file.read_text(encoding="utf-8").splitlines()[0]
    assert main.run(["synth", "--plant", str(fit), *QUICK, "-o", str(out), "-q"]) == 0


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["--kind", "gearbox"], 2, "--kind gearbox: must be one of clutch, friction-force, friction-speed"),
        (["--levels", "ten"], 2, "--levels ten: give levels as 30,40,90 or as from:to:step"),
        (["--levels", "10:100:7"], 2, "--levels 10:100:7: the step does not lead from 10 to 100"),
        (["--levels", "10,200"], 2, "--levels 200: a duty is at most 100 %"),
        (["--hold", "0"], 2, "--hold 0: give a number above 0, 1e+07 at most"),
        (["--noise-nm", "-1"], 2, "--noise-nm -1: give a number from 0 to 1e+06"),
        (["--plant", "none.json"], 3, "none.json: no such file; give the fit.json that eaid wrote"),
        (["--kind", "friction-force", "--release", "3"], 2, "--release: nobody has published"),
        (["--seed", "-3"], 2, "--seed -3: give a whole number from 0 to 9007199254740991"),
        (["--duty-file", "d.csv", "--hold", "3"], 2, "--duty-file: says levels and times itself"),
        (["--duty-file", "d.csv", "--plan", "p.csv"], 2, "--duty-file and --plan exclude each other"),
        (["--plan", "p.csv", "--repeats", "3"], 2, "--plan: says levels and times itself"),
        (["--seed", "7" * 26], 2, "--seed 7777"),
        (["--levels", "1e300"], 2, "--levels 1e+300: give a number above 0"),
        (["--tau1-scatter", "1000"], 2, "--tau1-scatter 1000: give a number from 0 to 3"),
        (["--noise-nm", "1e308"], 2, "--noise-nm 1e+308: give a number from 0"),
        (["--hold", "inf"], 2, "--hold inf: give a number"),
        (["--rate-hz", "1e9"], 2, "--rate-hz 1e+09: give a number"),
        (["--repeats", "1000000000"], 2, "--repeats 1000000000: give a whole number"),
        (["--excitation", "jumps", "-o", "logs"], 2, "--excitation jumps: must be one of staircase, random, prbs"),
        (["--excitation", "prbs", "--plan", "p.csv", "-o", "logs"], 2, "--plan and --excitation exclude each other"),
        (["--plan", "p.csv"], 3, "p.csv: no such file; give a CSV order,level,repeat,idle_s,hold_s,release_s"),
        (["-o", "none/d.h5"], 2, "none/d.h5: the folder none does not exist; make it first"),
    ],
)
def test_bad_calls_get_their_sentence_and_leave_nothing(
    arguments: list[str], code: int, sentence: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main.run(["synth", *arguments]) == code
    told = capsys.readouterr().err
    assert told.startswith(f"error: {sentence}") and told.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_friction_fit_says_its_own_kind(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fit = tmp_path / "ff.json"
    levels = [{"level": 50, "Ts": 1.0, "tau1": 0.1, "tau2": 2.0}]
    content = {"schema": "eaid/fit/1", "data": {"kind": "friction-force"}, "friction": {"C": 0.85, "levels": levels}}
    fit.write_text(json.dumps(content))
    call = [
        "synth",
        "--plant",
        str(fit),
        "--hold",
        "5",
        "--rate-hz",
        "50",
        "-o",
        str(tmp_path / "logs"),
        "-q",
        "--json",
    ]
    assert main.run(call) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["kind"] == "friction-force" and [row["level"] for row in summary["runs"]] == [50, 50]
    assert summary["inputs"][0]["path"] == str(fit) and len(summary["inputs"][0]["sha256"]) == 64
    assert main.run([*call, "--force", "--kind", "clutch"]) == 3


def test_steps_that_lead_from_end_to_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call = [
        "synth",
        "--levels",
        "20:80:30",
        "--repeats",
        "1",
        "--hold",
        "1",
        "--idle",
        "0",
        "--release",
        "0",
        "--rate-hz",
        "50",
    ]
    assert main.run([*call, "-o", str(tmp_path / "logs"), "-q", "--json"]) == 0
    assert [row["level"] for row in json.loads(capsys.readouterr().out)["runs"]] == [20, 50, 80]


def test_the_run_table_of_a_plan_is_recorded_as_it_says(tmp_path: Path) -> None:
    table, folder, data = tmp_path / "plan.csv", tmp_path / "logs", tmp_path / "d.h5"
    table.write_text(
        "order,level,repeat,idle_s,hold_s,release_s\n1,90,1,1,3,1\n2,40,1,1,5,1\n3,40,2,1,5,1\n4,90,2,1,3,1\n"
    )
    call = ["synth", "--plan", str(table), "--rate-hz", "50", "-q"]
    assert main.run([*call, "-o", str(folder)]) == 0
    assert sorted(path.name for path in folder.iterdir()) == [
        f"synthetic-clutch-{level}-r{repeat}.csv" for level in ("040.0", "090.0") for repeat in (1, 2)
    ]
    time_s, duty_pct, _ = np.loadtxt(folder / "synthetic-clutch-040.0-r2.csv", delimiter=",", skiprows=2).T
    assert len(time_s) == 350 and duty_pct[49:51].tolist() == [0, 40] and duty_pct[299:301].tolist() == [40, 0]
    assert main.run([*call, "-o", str(data)]) == 0
    runs, _ = read_dataset(data, "d.h5", "")
    assert sorted((run.level, run.edge) for run in runs).count((40.0, "falling")) == 2


def test_a_duty_file_becomes_a_dataset_of_its_steps(tmp_path: Path) -> None:
    duty, data = tmp_path / "duty.csv", tmp_path / "d.h5"
    duty.write_text("time_s,duty_pct\n0,0\n2,40\n6,0\n10,90\n14,0\n16,0\n")
    call = ["synth", "--duty-file", str(duty), "--repeats", "1", "--rate-hz", "100", "-q"]
    assert main.run([*call, "-o", str(data)]) == 0
    runs, faults = read_dataset(data, "d.h5", "")
    assert not faults
    assert sorted((run.level, run.edge) for run in runs) == [
        (40, "falling"), (40, "rising"), (90, "falling"), (90, "rising")
    ]  # fmt: skip


def test_a_force_file_drives_the_friction_rig(tmp_path: Path) -> None:
    force = tmp_path / "force.csv"
    force.write_text("time_s,force_n\n0,0\n1,170\n61,170\n")
    call = [
        "synth",
        "--kind",
        "friction-force",
        "--duty-file",
        str(force),
        "--repeats",
        "1",
        "--rate-hz",
        "10",
        "--clean",
    ]
    assert main.run([*call, "-o", str(tmp_path / "logs"), "-q"]) == 0
    (file,) = (tmp_path / "logs").iterdir()
    assert np.loadtxt(file, delimiter=",", skiprows=2)[-1, 2] == pytest.approx(2.4645, abs=1e-3)
