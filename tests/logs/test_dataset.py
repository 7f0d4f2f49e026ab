"""data.h5: what goes in comes out, in the same bytes; and a dataset of a user's own script is read too."""

import dataclasses
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from eaid.logs.options import ReadOptions

from eaid.apparatus import Apparatus
from eaid.cli.inputs import runs_from
from eaid.cli.main import run
from eaid.findings import finding
from eaid.logs.dataset import write_dataset
from eaid.logs.read import read_runs
from eaid.logs.run import Run
from eaid.steps.build import build_stepset
from eaid.steps.stepset import Level, StepSet

N = 4000


def write_logs(folder: Path, noise: float = 0.01) -> Path:
    folder.mkdir(exist_ok=True)
    t = np.arange(N) / 100.0
    for level in (30, 60, 90):
        for repeat in (1, 2):
            u = np.where((t >= 5) & (t < 30), level, 0)
            rise = np.where(t >= 5, -np.expm1(-(t - 5) / 0.5), 0) - np.where(t >= 30, -np.expm1(-(t - 30) / 1.0), 0)
            y = 0.04 * level * rise + noise * np.random.default_rng(level + repeat).normal(size=N) + 0.2
            lines = ["# synthetic: made by this test", "time_s,duty_pct,torque_nm"]
            lines += [f"{a:.2f},{b:d},{c!r}" for a, b, c in zip(t.tolist(), u.tolist(), y.tolist(), strict=True)]
            (folder / f"u{level}_{repeat}.csv").write_text("\n".join(lines) + "\n")
    return folder


def same(a: StepSet, b: StepSet) -> None:
    """Bit by bit, but for the paths that the user gave."""
    for one, other in zip((*a.levels, *a.releases), (*b.levels, *b.releases), strict=True):
        for name in (field.name for field in dataclasses.fields(Level)):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert a.runs == b.runs
    for name in ("kind", "input_unit", "output_unit", "apparatus", "warnings", "synthetic"):
        assert getattr(a, name) == getattr(b, name)


def test_a_dataset_gives_the_same_steps_as_its_logs(tmp_path: Path) -> None:
    logs = write_logs(tmp_path / "logs")
    assert run(["ingest", str(logs), "-q", "-o", str(tmp_path / "d.h5")]) == 0
    _, of_logs = runs_from([logs])
    _, of_dataset = runs_from([tmp_path / "d.h5"])
    same(of_logs, of_dataset)
    assert of_logs.synthetic == "made by this test"
    assert [level.level for level in of_logs.releases] == [30.0, 60.0, 90.0]


def test_columns_that_runs_have_in_common_are_unpacked_once(tmp_path: Path) -> None:
    """Rises and falls stand in turn, each with a time axis and inputs of its own."""
    write_logs(tmp_path / "logs")
    assert run(["ingest", str(tmp_path / "logs"), "-q", "-o", str(tmp_path / "d.h5")]) == 0
    runs = read_runs([tmp_path / "d.h5"])
    assert len(runs) == 12
    assert len({id(one.time_s) for one in runs}) == len({one.time_s.tobytes() for one in runs}) == 2
    assert len({id(one.input) for one in runs}) == len({one.input.tobytes() for one in runs}) == 4
    assert len({id(one.output) for one in runs}) == 12


def test_the_same_logs_give_the_same_bytes(tmp_path: Path) -> None:
    logs = write_logs(tmp_path / "logs")
    for name in ("a.h5", "b.h5"):
        assert run(["ingest", str(logs), "-q", "-o", str(tmp_path / name)]) == 0
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    assert run(["ingest", str(tmp_path / "a.h5"), "-q", "-o", str(tmp_path / "c.h5")]) == 0
    assert (tmp_path / "c.h5").read_bytes() == (tmp_path / "a.h5").read_bytes()


def test_a_dataset_takes_at_most_half_of_its_raw_size(tmp_path: Path) -> None:
    logs = write_logs(tmp_path / "logs")
    assert run(["ingest", str(logs), "-q", "-o", str(tmp_path / "d.h5")]) == 0
    assert (tmp_path / "d.h5").stat().st_size < 0.5 * 6 * N * 3 * 8


def test_attributes_of_the_contract(tmp_path: Path) -> None:
    logs = write_logs(tmp_path / "logs")
    rig = "surfaces=1,inner_radius_m=0.03"
    assert run(["ingest", str(logs), "-q", "--apparatus", rig, "-o", str(tmp_path / "d.h5")]) == 0
    with h5py.File(tmp_path / "d.h5") as file:
        assert dict(file.attrs).items() >= {"schema": "eaid/data/1", "kind": "clutch", "input_unit": "%"}.items()
        assert file.attrs["surfaces"] == 1
        assert file.attrs["inner_radius_m"] == 0.03
        assert list(file["runs"]) == sorted(
            f"u{level}_{repeat}{end}" for level in (30, 60, 90) for repeat in (1, 2) for end in ("", "-release")
        )
        one = file["runs/u30_2"]
        assert {name: one[name].dtype for name in one} == dict.fromkeys(("time_s", "input", "torque_nm"), np.float64)
        assert (one.attrs["level"], one.attrs["repeat"], one.attrs["step_s"]) == (30.0, 2, 5.0)
        assert one.attrs["baseline_nm"] == pytest.approx(0.2, abs=0.002)
        assert one.attrs["source"].endswith("u30_2.csv")
        assert len(one.attrs["sha256"]) == 64


def by_hand(path: Path, **more: object) -> Path:
    """A dataset with no more than the contract asks for."""
    t = np.arange(2000) / 100.0
    with h5py.File(path, "w") as file:
        file.attrs.update({"schema": "eaid/data/1", "kind": "clutch", "input_unit": "%"})
        for name, level in (("first", 40.0), ("second", 80.0)):
            group = file.create_group(f"runs/{name}")
            group["time_s"] = t
            group["input"] = np.where(t >= 2, level, 0.0)
            group["torque_nm"] = np.where(t >= 2, 0.04 * level * -np.expm1(-(t - 2) / 0.3), 0.0) + 0.1
            group.attrs.update(
                {"level": level, "repeat": 1, "step_s": 2.0, "baseline_nm": 0.1, "source": "x", "sha256": ""}
            )
            group.attrs.update(more)
    return path


def test_a_users_own_dataset(tmp_path: Path) -> None:
    stepset = build_stepset(read_runs([by_hand(tmp_path / "d.h5")]))
    assert [level.level for level in stepset.levels] == [40.0, 80.0]
    np.testing.assert_allclose(stepset.levels[1].mean[-1], 3.2, atol=1e-9)
    assert stepset.apparatus == Apparatus()


def test_a_users_own_dataset_without_any_attributes_of_runs(tmp_path: Path) -> None:
    path = by_hand(tmp_path / "d.h5")
    with h5py.File(path, "a") as file:
        for group in file["runs"].values():
            for name in list(group.attrs):
                del group.attrs[name]
    stepset = build_stepset(read_runs([path]))
    assert [level.level for level in stepset.levels] == [40.0, 80.0]
    assert stepset.runs[0].step_s == 2.0


@pytest.mark.parametrize(
    ("damage", "sentence"),
    [
        (lambda f: f.attrs.__setitem__("schema", "eaid/data/9"), "its schema is 'eaid/data/9', and this eaid"),
        (lambda f: f.attrs.__setitem__("kind", "brake"), "its kind is 'brake'; it must be one of clutch"),
        (lambda f: f.__delitem__("runs"), "holds no runs; ingest the logs again"),
        (lambda f: f["runs/first"].__delitem__("torque_nm"), "run first has no torque_nm; ingest the logs"),
        (lambda f: f["runs/first"].attrs.__setitem__("level", "high"), "run first: its level is no number"),
        (lambda f: f["runs/first/input"].__setitem__(7, np.nan), "sample 8, column input, is empty or not a number"),
        (lambda f: f["runs/first/time_s"].__setitem__(7, 0.0), "time falls at sample 8 (0 s after 0.06 s)"),
        (lambda f: f["runs/first/torque_nm"].__setitem__(slice(None), 1.0), "the output never changes (1 N·m "),
        (lambda f: f["runs/first/input"].__setitem__(slice(300, 400), 140.0), "the input is 140 % at 3 s, above 100"),
        (lambda f: f["runs/first"].attrs.__setitem__("step_s", 99.0), "the step at 99 s lies outside the log"),
        (lambda f: f.attrs.__setitem__("apparatus", "{"), "its apparatus is not a JSON object"),
        (lambda f: f.attrs.__setitem__("surfaces", "two"), "its apparatus holds what is no number"),
        (lambda f: f.__setitem__("runs/first/link", h5py.ExternalLink("/etc/passwd", "x")), "is a link to another"),
    ],
)  # fmt: skip
def test_bad_datasets(damage: object, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = by_hand(tmp_path / "d.h5")
    with h5py.File(path, "a") as file:
        damage(file)  # type: ignore[operator]
    assert run(["ingest", str(path), "-o", str(tmp_path / "e.h5")]) == 3
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith(f"error: {path}: ")
    assert sentence in said[0]
    assert not (tmp_path / "e.h5").exists()


def test_reading_a_dataset_imports_neither_pandas_nor_numba(tmp_path: Path) -> None:
    import subprocess
    import sys

    path = by_hand(tmp_path / "d.h5")
    code = (
        "import sys; from pathlib import Path; from eaid.cli.inputs import runs_from\n"
        f"runs_from([Path({str(path)!r})])\n"
        "print([name for name in ('pandas', 'matplotlib', 'numba') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_reference_and_findings_survive(tmp_path: Path) -> None:
    (first, *_) = build_runs = read_runs([by_hand(tmp_path / "d.h5")])
    said = (finding("rows-dropped", "a", dropped=1, count=3),)
    changed: list[Run] = [dataclasses.replace(r, reference_nm=r.output, findings=said) for r in build_runs]
    write_dataset(tmp_path / "e.h5", changed, kind="clutch", apparatus=Apparatus(surfaces=1))
    again = read_runs([tmp_path / "e.h5"])[0]
    assert again.findings == said
    assert again.reference_nm is not None
    np.testing.assert_array_equal(again.reference_nm, first.output)
    assert again.apparatus == Apparatus(surfaces=1)


def test_bytes_that_look_like_a_mention_of_a_text_refuse_no_dataset(tmp_path: Path) -> None:
    """A check that guessed at addresses in bytes refused 10 of 100 synthetic sets; the library itself tells damage."""
    path = tmp_path / "data.h5"
    runs = [replace(one, level=30.0, repeat=1) for one in read_runs([write_logs(tmp_path / "logs") / "u30_1.csv"])]
    write_dataset(path, runs, kind="clutch", apparatus=Apparatus())
    with h5py.File(path, "a") as file:  # which takes the seal off
        file.attrs["texts"] = ["of", "free", "length"]
        del file.attrs["digest"]
    data = path.read_bytes()
    mention = (1 << 30).to_bytes(4, "little") + data.index(b"GCOL").to_bytes(8, "little") + (1).to_bytes(4, "little")
    path.write_bytes(data + mention)
    (run,) = read_runs([path])
    assert np.array_equal(run.output, runs[0].output)


def test_runs_are_shortened_one_by_one(tmp_path: Path) -> None:
    """Hours at 10 kHz: the page needs a hundredth of each run, and never all of them at once."""
    import tracemalloc

    t = np.arange(100_000) / 100.0
    runs = [
        Run(f"r{k}", t, np.where(t >= 5, 50.0 + k, 0.0), t * (k + 1), "%", "N·m", "x", f"{k:064d}", level=50.0 + k,
            step_s=5.0, cut=True)
        for k in range(10)
    ]  # fmt: skip
    write_dataset(tmp_path / "d.h5", runs, kind="clutch", apparatus=Apparatus())
    read_runs([tmp_path / "d.h5"], ReadOptions(each=lambda run: run))  # with all that is imported

    def short(run: Run) -> Run:
        return replace(run, **{name: getattr(run, name)[:10].copy() for name in ("time_s", "input", "output")})

    tracemalloc.start()
    found = read_runs([tmp_path / "d.h5"], ReadOptions(each=short))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert [len(run.output) for run in found] == [10] * 10
    assert peak < 3 * 24 * len(t)  # a run takes 24 bytes a sample, all of them 240


def test_a_unit_that_nobody_knows_stays_unknown(tmp_path: Path) -> None:
    logs = write_logs(tmp_path / "logs")
    for path in logs.iterdir():
        path.write_text(path.read_text().replace("duty_pct,torque_nm", "u,y"))
    assert run(["ingest", str(logs), "-q", "-o", str(tmp_path / "d.h5")]) == 0
    (_, said), (_, again) = runs_from([logs]), runs_from([tmp_path / "d.h5"])
    assert (again.input_unit, again.output_unit) == (said.input_unit, said.output_unit) and said.output_unit == ""


def test_a_users_own_dataset_on_a_clock_since_1970(tmp_path: Path) -> None:
    """Stamps of 1.7e9 s cost no digit: the run's own time begins at 0, and its instants with it."""
    path = by_hand(tmp_path / "d.h5", step_s=1.7e9 + 2.0, until_s=1.7e9 + 15.0)
    with h5py.File(path, "a") as file:
        for group in file["runs"].values():
            group["time_s"][:] += 1.7e9
    for one in read_runs([path]):
        assert one.time_s[0] == 0.0 and one.time_s[-1] == pytest.approx(19.99, abs=1e-6)
        assert (one.step_s, one.until_s, one.start_s) == pytest.approx((2.0, 15.0, 1.7e9))


def test_texts_of_a_users_own_dataset_may_be_bytes(tmp_path: Path) -> None:
    path = by_hand(tmp_path / "d.h5", source=np.bytes_(b"bench.csv"), edge=np.bytes_(b"falling"))
    with h5py.File(path, "a") as file:
        file.attrs["input_unit"] = np.bytes_(b"V")
    for one in read_runs([path]):
        assert (one.source, one.edge, one.input_unit) == ("bench.csv", "falling", "V")
