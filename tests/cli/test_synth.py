"""`eaid synth`: datasets and folders of CSV, from the reference plant, a fit, a plan or a duty file."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

import eaid

QUICK = "synth --levels 40,90 --repeats 2 --hold 2 --idle 1 --release 1 --rate-hz 100"


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def csv_of(folder):
    """The columns of the folder's only log."""
    (file,) = Path(folder).iterdir()
    return np.loadtxt(file, delimiter=",", skiprows=2).T


def test_a_dataset_its_summary_and_another_seed(run_eaid):
    ran = run_eaid(QUICK, "--json")
    told = json.loads(ran.out)
    assert ran.err == (
        "synthetic.h5: 4 synthetic runs of the reference plant (docs/synthetic.md), seed 0; "
        "next: eaid fit synthetic.h5\n"
    )
    assert (told["kind"], told["seed"]) == ("clutch", 0) and told["runs"][0]["samples"] == 400
    assert [row["level"] for row in told["runs"]] == [40, 40, 90, 90]
    assert run_eaid(f"{QUICK} -q -o b.h5 --seed 1").code == 0
    assert Path("synthetic.h5").read_bytes() != Path("b.h5").read_bytes()
    with h5py.File("synthetic.h5") as file:
        runs = [dict(run.attrs) for run in file["runs"].values()]
        assert "recorded on no rig" in file.attrs["synthetic"]
    assert sorted((run["level"], run["step_s"]) for run in runs) == [
        (u, at) for u in (40, 90) for at in (1.0, 1.0, 3.0, 3.0)
    ]


def test_a_folder_of_csv_holds_the_same_numbers_as_the_dataset(run_eaid):
    for out in ("d.h5", "logs"):
        assert run_eaid(QUICK, "-q", "-o", out).code == 0
    assert sorted(path.name for path in Path("logs").iterdir()) == [
        f"synthetic-clutch-{level}-r{repeat}.csv" for level in ("040.0", "090.0") for repeat in (1, 2)
    ]
    one, other = eaid.read("d.h5"), eaid.read("logs")
    for first, second in zip(one.levels, other.levels, strict=True):
        assert first.level == second.level
        np.testing.assert_array_equal(first.runs, second.runs)


def test_a_force_file_drives_the_friction_rig(run_eaid):
    Path("force.csv").write_text("time_s,force_n\n0,0\n1,170\n61,170\n")
    words = "synth --kind friction-force --duty-file force.csv --repeats 1 --rate-hz 10 --clean -o logs -q"
    assert run_eaid(words).code == 0
    assert csv_of("logs")[2, -1] == pytest.approx(2.4645, abs=1e-3)
