"""`eaid fit` through its runner: exit codes, files, tables, sentences; real logs with one command each."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from eaid.cli import main

ROOT = Path(__file__).parents[2]
REAL = ROOT / "../shared/realdata"
CLUTCH = ROOT / "datasets" / "clutch.h5"
QUICK = ["--ci", "none", "-q"]


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small synthetic clutch set with a release at the end."""
    path = tmp_path_factory.mktemp("fit") / "small.h5"
    code = main.run(
        ["synth", "--levels", "20,40,60,80,100", "--repeats", "2", "--hold", "8", "--idle", "1", "--release", "4",
         "--rate-hz", "100", "-o", str(path), "-q"]
    )  # fmt: skip
    assert code == 0
    return path


def test_a_dataset_becomes_a_fit(small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "fit.json"
    assert main.run(["fit", str(small), "-o", str(out), "--ci", "none", "--tables"]) == 0
    told = capsys.readouterr()
    result = json.loads(out.read_text())
    assert result["schema"] == "eaid/fit/1" and result["converged"] is True
    assert {"friction", "nonlinear", "linear", "release"} <= result.keys()
    assert result["options"]["share"] == 0.85 and result["options"]["ci"] == "none" and result["seed"] == 0
    assert len(result["data"]["sources"]) == 20 and len(result["data"]["sources"][0]["sha256"]) == 64
    assert "Nonlinear model. " in told.out and "B_m = " in told.out
    assert "Release. How the output falls" in told.out
    assert told.err.splitlines()[-1] == f"{out}: friction, nonlinear, linear, release of 10 clutch runs, synthetic"
    assert f"next   eaid tune-rc {out}" in told.out
    assert "synthetic" in result["data"]


def test_the_same_input_twice_gives_the_same_bytes(small: Path, tmp_path: Path) -> None:
    for name in ("a.json", "b.json"):
        assert main.run(["fit", str(small), "-o", str(tmp_path / name), "-q"]) == 0
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_json_on_stdout_is_the_file(small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "fit.json"
    assert main.run(["fit", str(small), "-o", str(out), "--json", *QUICK]) == 0
    assert capsys.readouterr().out == out.read_text()


def test_options_reach_the_fit(small: Path, tmp_path: Path) -> None:
    out = tmp_path / "fit.json"
    arguments = ["--model", "nonlinear,linear", "--share", "0.8", "--loss", "huber",
                 "--hold-out", "60", "--bounds-levels", "40:100"]  # fmt: skip
    assert main.run(["fit", str(small), "-o", str(out), *arguments, *QUICK]) == 0
    result = json.loads(out.read_text())
    assert "friction" not in result and result["nonlinear"]["C"] == 0.8
    assert result["nonlinear"]["robust"]["loss"] == "huber"
    assert [row["level"] for row in result["nonlinear"]["hold_out"]["levels"]] == [60.0]
    assert result["linear"]["bounds"]["convention"] == "zero-offset"
    assert result["linear"]["bounds"]["levels"] == [40.0, 80.0, 100.0]


def test_a_free_share_and_chosen_levels(small: Path, tmp_path: Path) -> None:
    out = tmp_path / "fit.json"
    assert main.run(["fit", str(small), "-o", str(out), "--share", "free", "--levels", "40:100", *QUICK]) == 0
    result = json.loads(out.read_text())
    assert result["nonlinear"]["C_free"] is True and result["friction"]["C"] is None
    assert result["nonlinear"]["u_range"] == [40.0, 100.0]


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["--ci", "maybe"], 2, "error: --ci maybe: must be one of robust, bootstrap, white, none\n"),
        (["--share", "most"], 2, "error: --share most: must be free or a number\n"),
        (["--share", "1"], 2, "error: --share 1: the share of the fast part lies between 0 and 1; or say free\n"),
        (["--hold-out", "a"], 2, "error: --hold-out a: write numbers with commas between them, as 40,70\n"),
        (["--hold-out", "45"], 2, "error: --hold-out 45: no such level; there are 20, 40, 60, 80, 100\n"),
        (
            ["--bounds-levels", "1:5"],
            3,
            "error: --bounds-levels 1:5: no log holds 1:5; levels found: 20, 40, 60, 80, 100\n",
        ),
        (["--model", "cubic"], 2, "error: --model cubic: must be one of friction, nonlinear, linear\n"),
        (["--estimator", "both"], 2, "error: --estimator both: must be one of auto, joint, two-stage\n"),
    ],
)
def test_wrong_usage_is_one_sentence_and_writes_nothing(
    arguments: list[str], code: int, sentence: str, small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main.run(["fit", str(small), "-o", str(tmp_path / "fit.json"), *arguments, "-q"]) == code
    assert capsys.readouterr().err == sentence
    assert not list(tmp_path.iterdir())


def test_an_earlier_fit_is_left_alone(small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "fit.json"
    out.write_text("mine")
    assert main.run(["fit", str(small), "-o", str(out), *QUICK]) == 2
    assert out.read_text() == "mine" and "give --force to overwrite it" in capsys.readouterr().err
    assert main.run(["fit", str(small), "-o", str(out), "--force", *QUICK]) == 0
    assert json.loads(out.read_text())["schema"] == "eaid/fit/1"


def test_a_fit_that_does_not_converge_is_written_marked_and_exits_with_4(
    small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from eaid.fitting import nonlinear, solver, verdict

    def stops_at_once(problem: solver.Problem, start: object) -> solver.EndPoint:
        return solver.EndPoint(start, problem.value(start)[0], 1)  # type: ignore[arg-type]

    monkeypatch.setattr(nonlinear, "approach", stops_at_once)
    monkeypatch.setattr(nonlinear, "ended", lambda ends, _: ends)
    monkeypatch.setattr(nonlinear, "broad_starts", lambda *_: [])
    polish = verdict.polish
    monkeypatch.setattr(verdict, "polish", lambda *problem: polish(*problem, steps=0))
    out = tmp_path / "fit.json"
    assert main.run(["fit", str(small), "-o", str(out), "--estimator", "joint", *QUICK]) == 4
    assert capsys.readouterr().err == f"error: {out}: is written and marked; do not use its numbers\n"
    result = json.loads(out.read_text())
    assert result["converged"] is False and result["nonlinear"]["solver"]["converged"] is False
    assert result["findings"][0]["code"] == "fit-not-converged" and result["findings"][0]["severity"] == "stop"


def test_the_shipped_sets_fit(tmp_path: Path) -> None:
    for kind, part in (("clutch", "nonlinear"), ("friction-force", "friction"), ("friction-speed", "friction")):
        out = tmp_path / f"{kind}.json"
        assert main.run(["fit", str(CLUTCH.with_name(f"{kind}.h5")), "-o", str(out), *QUICK]) == 0
        result = json.loads(out.read_text())
        assert result["data"]["kind"] == kind and result[part]["solver"]["converged"]
    assert {"Ts", "tau1", "tau2", "C_f"} == json.loads((tmp_path / "friction-force.json").read_text())["friction"][
        "trends"
    ].keys()


@pytest.mark.skipif(not REAL.is_dir(), reason="the recorded logs are not beside the checkout")
def test_a_real_clutch_with_one_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "fit.json"
    code = main.run(
        ["fit", str(REAL / "ea-clutch"), "--columns", 'time=Time,output="Load Cell"', "--units", "time=us,output=N",
         "--name-pattern", "_V={level}_", "--step-at", "2", "--until", "5", "--repair", "--ci", "none", "-o", str(out)]
    )  # fmt: skip
    assert code == 0
    result = json.loads(out.read_text())
    assert result["data"]["levels"] == [100, 125, 150, 175, 200, 225, 250, 275, 300]
    assert result["data"]["repeats"] == [3] * 9 and result["converged"]
    told = capsys.readouterr().err
    codes = {one["code"] for one in result["findings"]}
    assert {"rows-dropped", "output-decays-under-hold", "taus-meet", "constraint-holds"} <= codes
    assert "decays-under-hold" not in codes  # nothing is said twice
    assert result["nonlinear"]["rmse"] < 0.03443  # another minimum lies at 0.0384
    assert "RuntimeWarning" not in told


@pytest.mark.skipif(not REAL.is_dir(), reason="the recorded logs are not beside the checkout")
def test_real_friction_with_one_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "fit.json"
    logs = str(REAL / "friction-steps")
    assert main.run(["fit", logs, "--kind", "friction-force", "--ci", "none", "-o", str(out)]) == 0
    result = json.loads(out.read_text())
    assert [row["level"] for row in result["friction"]["levels"]] == [1, 3, 5, 7]
    assert result["friction"]["levels"][0]["stress_kpa"] == 100 and result["friction"]["trends"].keys() == {"Ts"}
    assert capsys.readouterr().err.count("warning: ") == 3  # the gravest; --verbose shows all
    assert {"output-is-no-torque", "trend-needs-levels"} <= {one["code"] for one in result["findings"]}


def test_a_log_is_never_the_output(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = small.read_bytes()
    assert main.run(["fit", str(small), "-o", str(small), "--force", "-q"]) == 2
    assert small.read_bytes() == before and str(small) in capsys.readouterr().err


def test_the_threads_of_blas_change_no_byte(small: Path, tmp_path: Path) -> None:
    for count in ("1", "2"):
        command = [sys.executable, "-m", "eaid", "fit", str(small), "-o", str(tmp_path / f"{count}.json"), "-q"]
        subprocess.run(command, check=True, env={**os.environ, "OPENBLAS_NUM_THREADS": count, "OMP_NUM_THREADS": count})
    assert (tmp_path / "1.json").read_bytes() == (tmp_path / "2.json").read_bytes()


def test_a_fit_answers_in_eight_lines(small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["fit", str(small), "-o", str(tmp_path / "fit.json")]) == 0
    told = capsys.readouterr()
    assert len(told.out.splitlines()) <= 8
    assert told.out.splitlines()[0].startswith("fit    nonlinear 9")
    assert all(len(line) <= 80 for line in told.out.splitlines()[:-1])
    assert len([line for line in told.err.splitlines() if line.startswith(("stop", "warning", "note"))]) <= 3
    assert told.out.splitlines()[-1] == f"next   eaid tune-rc {tmp_path / 'fit.json'}"
