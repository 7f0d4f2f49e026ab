"""`eaid ingest` as users call it: table, JSON, files, exit codes; and the recorded logs of other rigs."""

import json
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from eaid.cli.inputs import runs_from
from eaid.cli.main import run
from eaid.errors import UsageError
from eaid.reading import pairs

REALDATA = Path(__file__).parents[2] / "../shared/realdata"
needs_realdata = pytest.mark.skipif(not REALDATA.is_dir(), reason="the recorded logs are not beside the project")
EA_CLUTCH = [
    "--columns", 'time=Time,output="Load Cell"', "--units", "time=us,output=N", "--name-pattern", "_V={level}_",
    "--step-at", "2.0", "--until", "5.0",
]  # fmt: skip


def write_log(path: Path, level: float = 50.0, rows: int = 2000) -> Path:
    t = np.arange(rows) / 100.0
    u = np.where(t >= 5, level, 0.0)
    y = 0.1 + np.where(t >= 5, 0.04 * level * -np.expm1(-(t - 5) / 0.4), 0.0) + 0.01 * np.sin(999 * t)
    lines = ["time_s,duty_pct,torque_nm", *(f"{a:.2f},{b:g},{c:.6f}" for a, b, c in zip(t, u, y, strict=True))]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_column_that_is_mistyped_is_told_the_one_meant(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = str(write_log(tmp_path / "a.csv"))
    assert run(["ingest", log, "--columns", "output=torqe_nm", "-o", str(tmp_path / "d.h5")]) == 3
    assert "did you mean torque_nm?" in capsys.readouterr().err


def test_table_and_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs = [str(write_log(tmp_path / f"u{level}.csv", level)) for level in (30, 60)]
    assert run(["ingest", *logs, "-o", str(tmp_path / "d.h5")]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[0] == "clutch: 2 levels, 2 runs, 100 Hz"
    assert out.splitlines()[3].split() == ["30", "1", "0", "0.100", "1.200", "0", "14.99", "0"]
    assert len(out.splitlines()) == 5  # a line a level, and no doubts
    assert err.splitlines() == [
        "reading logs: 2 to do",
        "columns of 2 logs: time = time_s [s], input = duty_pct [%], output = torque_nm [N·m]; left: none",
        f"{tmp_path / 'd.h5'}: 2 runs, 2 levels; next: eaid fit {tmp_path / 'd.h5'}",
    ]
    with h5py.File(tmp_path / "d.h5") as file:
        assert list(file["runs"]) == ["u30", "u60"]


def test_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = str(write_log(tmp_path / "a.csv"))
    assert run(["ingest", log, "--json", "-q", "-o", str(tmp_path / "d.h5")]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    result = json.loads(out)
    assert result["schema"] == "eaid/ingest/1"
    assert result["levels"] == [{"level": 50.0, "repeats": 1, "samples": 1500, "runs": ["a"]}]
    (row,) = result["runs"]
    assert row["step_s"] == 5.0
    assert row["source"] == log
    assert row["findings"] == []


def test_default_name_and_no_overwriting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / "a.csv")
    assert run(["ingest", "a.csv", "-q"]) == 0
    before = (tmp_path / "data.h5").read_bytes()
    assert run(["ingest", "a.csv", "-q"]) == 2
    assert (
        capsys.readouterr().err == "error: data.h5: exists already; give --force to overwrite it, or another --output\n"
    )
    assert (tmp_path / "data.h5").read_bytes() == before
    assert run(["ingest", "a.csv", "-q", "--force"]) == 0
    assert run(["ingest", "a.csv", "-q", "-o", "no/such/folder.h5"]) == 2


def test_a_failed_call_leaves_earlier_results_untouched(tmp_path: Path) -> None:
    write_log(tmp_path / "a.csv")
    (tmp_path / "bad.csv").write_text("time_s,duty_pct,torque_nm\n0,0,x\n")
    output = tmp_path / "d.h5"
    output.write_text("earlier")
    assert run(["ingest", str(tmp_path / "a.csv"), str(tmp_path / "bad.csv"), "--force", "-o", str(output)]) == 3
    assert output.read_text() == "earlier"
    assert sorted(item.name for item in tmp_path.iterdir()) == ["a.csv", "bad.csv", "d.h5"]


def test_missing_logs_are_all_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    assert run(["ingest", str(tmp_path / "x.csv"), str(tmp_path / "empty"), "-o", str(tmp_path / "d.h5")]) == 3
    assert capsys.readouterr().err.splitlines() == [
        f"error: {tmp_path}/x.csv: no such file or folder; check the path",
        f"error: {tmp_path}/empty: holds no logs; give the folder that does",
    ]


def test_pairs() -> None:
    assert pairs("--columns", 'time=Time,input=Volts,output="Load Cell, N"') == {
        "time": "Time",
        "input": "Volts",
        "output": "Load Cell, N",
    }
    assert pairs("--columns", " time = t , output = a=b ") == {"time": "t", "output": "a=b"}
    assert pairs("--columns", None) == {}
    for wrong in ("time", "time=", "=x", "time=a,time=b"):
        with pytest.raises(UsageError):
            pairs("--columns", wrong)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("radius=3", "--apparatus radius: must be one of inner_radius_m, outer_radius_m, surfaces, "),
        ("surfaces=two", "--apparatus surfaces=two: is no number"),
        ("outer_radius_m=-1", "--apparatus outer_radius_m=-1: must be above zero"),
        ("outer_radius_m=nan", "--apparatus outer_radius_m=nan: must be above zero"),
        ("outer_radius_m=0.01", "--apparatus: inner_radius_m must be below outer_radius_m"),
    ],
)
def test_bad_apparatus(text: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = str(write_log(tmp_path / "a.csv"))
    assert run(["ingest", log, "--apparatus", text, "-o", str(tmp_path / "d.h5")]) == 2
    assert capsys.readouterr().err.startswith(f"error: {sentence}")


@needs_realdata
def test_ea_clutch_by_one_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = str(REALDATA / "ea-clutch")
    assert run(["ingest", folder, *EA_CLUTCH, "-o", str(tmp_path / "d.h5")]) == 3  # one log needs --repair
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(said) == 6
    assert all("20241103_17_15_12" in line for line in said)
    assert "time falls at row 89589 (0 s after 6.999961 s); sort the rows, or drop such rows" in said[0]
    assert run(["ingest", folder, *EA_CLUTCH, "--repair", "-q", "--json", "-o", str(tmp_path / "d.h5")]) == 0
    result = json.loads(capsys.readouterr().out)
    assert [level["level"] for level in result["levels"]] == [100.0 + 25 * k for k in range(9)]
    assert [level["repeats"] for level in result["levels"]] == [3] * 9
    assert [level["repeats"] for level in result["releases"]] == [3] * 9
    assert (result["output_unit"], result["input_unit"]) == ("N", "")
    told = {
        run["name"][:17]: [one["text"] for one in run["findings"]] for run in result["runs"] if run["edge"] == "rising"
    }
    assert any("dropped 14 of 89601 rows" in said for said in told["20241103_17_15_12"])
    over = [run for run in result["runs"] if run["name"].startswith("20241103_14_59_10") and run["edge"] == "rising"]
    assert "decays-under-hold" in [one["code"] for one in over[0]["findings"]]  # 275 V: the force overshoots
    assert over[0]["slip"]["peak_s"] == pytest.approx(0.716, abs=0.02)
    size = (tmp_path / "d.h5").stat().st_size
    assert size < 0.5 * 27 * 89_600 * 3 * 8


@needs_realdata
def test_friction_steps_by_one_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["ingest", str(REALDATA / "friction-steps"), "-q", "--json", "-o", str(tmp_path / "d.h5")]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["kind"], result["input_unit"], result["output_unit"]) == ("friction-force", "bar", "N")
    assert [(level["level"], level["repeats"]) for level in result["levels"]] == [(1, 4), (3, 4), (5, 4), (7, 4)]


FORMATS = [
    ("quarc_matrix*", ["--units", "input=V,output=V", "--rest", "-5"], 0, "2 runs, 1 level"),
    ("quarc_matrix*", ["--units", "input=%"], 3, "the input is -5 % at 0 s, below 0; if it is not in %, say"),
    ("quarc_matrix*", [], 0, "2 runs, 0 levels"),
    ("simulink_dataset*", [], 3, "holds MATLAB objects (a Simulink Dataset or timeseries) only; in MATLAB, save it as"),
    ("simulink_structure*", [], 3, "no column is called torque (columns: time, Time (s), FORWARD VELOCITY (m/s), "),
    ("csv_semicolon*", [], 3, "no column is called torque (columns: Tijd (s), Test 1, Test 2, Test 3, 0 Meting, "),
    ("tsv_no_header*", [], 3, "its 7 columns have no names; "),
    ("lvm_decimal*", [], 3, "nothing tells its level; give the input column, or --name-pattern with {level}"),
    ("lvm_x_column*", [], 3, "no column is called torque (columns: time, Pressão ABS. (MPa), Temperatura (°C), Vol"),
]


@needs_realdata
@pytest.mark.parametrize(("name", "arguments", "code", "sentence"), FORMATS)
def test_formats_of_other_rigs(
    name: str, arguments: list[str], code: int, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (path,) = (REALDATA / "formats").glob(name)
    assert run(["ingest", str(path), *arguments, "-o", str(tmp_path / "d.h5")]) == code
    assert sentence in capsys.readouterr().err


@needs_realdata
@pytest.mark.parametrize(
    ("name", "arguments", "rows"),
    [
        ("csv_semicolon*", ["--columns", "output=Test 1", "--units", "output=g"], 0),
        ("tsv_no_header*", ["--columns", "time=1,input=6,output=5", "--units", "time=ms,input=mm,output=N"], 0),
        ("simulink_structure*", ["--columns", "input=MOTOR VOLTAGE (V),output=FORWARD VELOCITY (m/s)"], 2201),
    ],
)
def test_formats_are_read_once_their_columns_are_named(name: str, arguments: list[str], rows: int) -> None:
    from eaid.logs.options import ReadOptions

    from eaid.logs.read import read_runs

    (path,) = (REALDATA / "formats").glob(name)
    said = dict(zip(arguments[::2], arguments[1::2], strict=True))
    options = ReadOptions(columns=pairs("", said.get("--columns")), units=pairs("", said.get("--units")))
    (run_,) = read_runs([path], options)
    assert len(run_.time_s) >= rows
    assert (np.diff(run_.time_s) > 0).all()
    assert np.ptp(run_.output) > 0


def test_a_thousand_runs_in_one_call(tmp_path: Path) -> None:
    text = write_log(tmp_path / "a.csv", rows=600).read_text()
    (tmp_path / "logs").mkdir()
    for k in range(1000):
        (tmp_path / "logs" / f"r{k:04d}.csv").write_text(f"# run {k}\n{text}")
    stepset = runs_from([tmp_path / "logs"])[1]
    assert len(stepset.runs) == 1000
    assert stepset.levels[0].runs.shape == (1000, 100)


def test_ctrl_c_leaves_nothing(tmp_path: Path) -> None:
    code = (
        "import sys, eaid.logs.read as r\n"
        "def stop(*a, **k): raise KeyboardInterrupt\n"
        "r.read_file = stop\n"
        "from eaid.cli.main import run\n"
        f"sys.exit(run(['ingest', {str(write_log(tmp_path / 'a.csv'))!r}, '-o', {str(tmp_path / 'd.h5')!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert done.stderr == "error: interrupted; nothing half-written is left\n"
    assert [item.name for item in tmp_path.iterdir()] == ["a.csv"]
