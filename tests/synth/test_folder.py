"""A folder of synthetic CSV: exact numbers, marked, and never in the way of a rig's own logs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eaid.errors import DataError, UsageError
from eaid.logs.read import read_runs
from eaid.results.plan import PlannedRun
from eaid.steps.build import build_stepset
from eaid.synth import datasets, plants
from eaid.synth.files import as_csv, read_input, read_plan, write_folder
from eaid.synth.logs import Disturbance, Protocol, synthesise, synthesise_plan

SHORT = Protocol(levels=(40.0, 90.0), repeats=2, idle_s=0.5, hold_s=1.0, release_s=0.5, rate_hz=100.0)


def test_csv_gives_every_number_back_and_says_what_it_is(tmp_path: Path) -> None:
    runs = synthesise(plants.clutch(), SHORT, replace(Disturbance(), resolution_nm=0.0), seed=0)
    write_folder(tmp_path / "logs", runs, force=False)
    files = sorted((tmp_path / "logs").iterdir())
    assert [file.name for file in files] == [f"{run.name}.csv" for run in runs]
    lines = files[0].read_text(encoding="utf-8").splitlines()
    assert (
        lines[0].startswith("# synthetic: eaid synth of the reference plant")
        and lines[1] == "time_s,duty_pct,torque_nm"
    )
    again = np.loadtxt(files[0], delimiter=",", skiprows=2)
    np.testing.assert_array_equal(again.T, [runs[0].time_s, runs[0].input, runs[0].output])


@pytest.mark.parametrize(("kind", "column"), [("friction-force", "force_n"), ("friction-speed", "speed_rpm")])
def test_friction_columns_have_their_own_name(kind: str, column: str) -> None:
    plant = plants.REFERENCE[kind]()
    run = synthesise(plant, replace(SHORT, levels=plant.levels[:1], release_s=0.0), Disturbance(), seed=0)[0]
    assert as_csv(run).splitlines()[1] == f"time_s,{column},torque_nm"


def test_force_replaces_earlier_synthetic_runs_and_nothing_else(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    write_folder(folder, synthesise(plants.clutch(), SHORT, Disturbance(), seed=0), force=False)
    with pytest.raises(UsageError, match="exists already; give force="):
        write_folder(folder, [], force=False)
    fewer = synthesise(plants.clutch(), replace(SHORT, levels=(70.0,), repeats=1), Disturbance(), seed=0)
    write_folder(folder, fewer, force=True)
    assert [file.name for file in folder.iterdir()] == ["synthetic-clutch-070.0-r1.csv"]
    (folder / "run7.csv").write_text("recorded\n")
    with pytest.raises(UsageError, match=r"holds run7.csv, which eaid synth did not make"):
        write_folder(folder, fewer, force=True)
    with pytest.raises(UsageError, match="is a file"):
        write_folder(folder / "run7.csv", fewer, force=True)
    with pytest.raises(UsageError, match="does not exist; make it first"):
        write_folder(tmp_path / "none" / "logs", fewer, force=True)


def test_a_duty_file_is_read_from_its_own_start(tmp_path: Path) -> None:
    path = tmp_path / "duty.csv"
    path.write_text("# mine\ntime_s,duty_pct\n5,0\n6,40\n\n8.5,0\n9,0\n")
    assert read_input(path) == ([(0.0, 0.0), (1.0, 40.0), (3.5, 0.0)], 4.0)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "its header is not time_s,duty_pct"),
        ("t,u\n0,1\n", "its header is not time_s,duty_pct"),
        ("time_s,duty_pct\n0,1\n", "fewer than two rows"),
        ("time_s,duty_pct\n0,1\n1,x\n", "row 3 holds '1,x', not 2 finite numbers"),
        ("time_s,duty_pct\n0,1\n1,2,3\n", "row 3 holds '1,2,3', not 2 finite numbers"),
        ("time_s,duty_pct\n0,1\n1,101\n", "row 3 holds duty_pct 101, outside 0 to 100 %"),
        ("time_s,duty_pct\n0,1\nnan,10\n", "row 3 holds 'nan,10', not 2 finite numbers"),
        ("time_s,duty_pct\n0,1\n0,2\n", "time falls or stands still at row 3"),
    ],
)
def test_bad_duty_files_are_refused_in_a_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "duty.csv"
    path.write_text(text)
    with pytest.raises(DataError, match=sentence):
        read_input(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError, match="is no text"):
        read_input(path)


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ("", "holds no runs; make it with eaid plan"),
        ("1,40,1,1,5\n", "row 2 holds '1,40,1,1,5', not 6 finite numbers"),
        ("1.5,40,1,1,5,1\n", "row 2 holds 1.5 as order, not a whole number"),
        ("1,40,0,1,5,1\n", "row 2 holds 0 as repeat, not a whole number of 1 or more"),
        ("1,40,1,1,5,1\n2,40,1,1,5,1\n", "row 3 is level 40, repeat 1 again \\(row 2\\)"),
    ],
)
def test_bad_run_tables_are_refused_in_a_sentence(tmp_path: Path, rows: str, sentence: str) -> None:
    path = tmp_path / "plan.csv"
    path.write_text("order,level,repeat,idle_s,hold_s,release_s\n" + rows)
    with pytest.raises(DataError, match=sentence):
        read_plan(path)


def test_a_run_of_a_plan_that_cannot_be_recorded_is_refused() -> None:
    planned = [PlannedRun(1, 120.0, 1, 1.0, 5.0, 1.0)]
    with pytest.raises(UsageError, match="a duty is at most 100 %"):
        synthesise_plan(plants.clutch(), planned, 100.0, Disturbance(), seed=0)


def test_a_folder_and_a_dataset_are_read_as_the_same_synthetic_steps(tmp_path: Path) -> None:
    runs = synthesise(plants.clutch(), replace(SHORT, idle_s=1.0, hold_s=3.0, release_s=1.0), Disturbance(), seed=2)
    write_folder(tmp_path / "logs", runs, force=False)
    datasets.write(tmp_path / "d.h5", runs)
    from_folder, from_dataset = (build_stepset(read_runs([tmp_path / name])) for name in ("logs", "d.h5"))
    for stepset in (from_folder, from_dataset):
        assert stepset.synthetic is not None and "recorded on no rig" in stepset.synthetic
        assert [level.level for level in stepset.levels] == [40.0, 90.0] and len(stepset.releases) == 2
    for one, other in zip(
        from_folder.levels + from_folder.releases, from_dataset.levels + from_dataset.releases, strict=True
    ):
        np.testing.assert_allclose(one.time_s, other.time_s, atol=1e-12)
        np.testing.assert_allclose(one.runs, other.runs, atol=1e-12)
