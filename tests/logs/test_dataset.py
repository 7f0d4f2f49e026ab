"""data.h5: what goes in comes out, in the same bytes; a dataset of a user's own script; and damaged ones."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from logs_written import text
from scipy.signal import lfilter

import eaid
from eaid import DataError
from eaid.files import hdf5_written_whole

T = np.arange(2000) / 100.0


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Two levels of two repeats, on at 5 s, off at 15 s; a comment says what made them."""
    folder = tmp_path_factory.mktemp("logs")
    for level in (30, 90):
        for repeat in (1, 2):
            u = np.where((T >= 5) & (T < 15), level, 0)
            rise = np.where(T >= 5, -np.expm1(-(T - 5) / 0.5), 0) - np.where(T >= 15, -np.expm1(-(T - 15) / 1.0), 0)
            y = 0.04 * level * rise + 0.01 * np.random.default_rng(level + repeat).normal(size=2000) + 0.2
            rows = text("time_s,duty_pct,torque_nm,torque_ref", T, u, [repr(v) for v in y.tolist()], u / 30)
            (folder / f"u{level}_{repeat}.csv").write_text("# synthetic: made by this test\n" + rows)
    return folder


@pytest.fixture(scope="module")
def stored(logs, tmp_path_factory):
    """The dataset of the logs."""
    path = tmp_path_factory.mktemp("data") / "d.h5"
    eaid.read(logs, apparatus="surfaces=1,inner_radius_m=0.03").save(path)
    return path


def test_a_dataset_gives_the_same_steps_as_its_logs(logs, stored):
    """Bit by bit, but for the paths that the user gave."""
    a, b = eaid.read(logs, apparatus="surfaces=1,inner_radius_m=0.03"), eaid.read(stored)
    for one, other in zip((*a.levels, *a.releases), (*b.levels, *b.releases), strict=True):
        for name in ("level", "time_s", "runs", "names"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert a.runs == b.runs and a.findings == b.findings and b.synthetic == "made by this test"
    assert (a.kind, a.input_unit, a.output_unit, a.apparatus) == (b.kind, b.input_unit, b.output_unit, b.apparatus)
    for run, again in zip(sorted(a.steps, key=lambda one: one.name), b.steps, strict=True):
        for field in dataclasses.fields(run):
            if field.name not in ("apparatus", "dataset", "source", "taken", "left"):
                np.testing.assert_array_equal(getattr(again, field.name), getattr(run, field.name), field.name)


@pytest.mark.slow
def test_a_log_that_is_fitted_as_recorded_goes_whole_into_a_dataset(tmp_path, run_eaid):
    """Cut into its steps it was one level of fifteen runs, and a fit of them NOT USABLE."""
    draw, t = np.random.default_rng(5), np.arange(3000) / 50.0
    u = np.where(t < 2, 0.0, draw.choice([20.0, 40.0, 80.0], 60)[(t / 1.1).astype(int)])
    y = 0.05 * lfilter([1 - np.exp(-1 / 15)], [1, -np.exp(-1 / 15)], np.append(0.0, u[:-1]))
    (tmp_path / "log.csv").write_text(text("time_s,duty_pct,torque_nm", t, u, y + 0.01 * draw.standard_normal(3000)))
    said = run_eaid("ingest", tmp_path / "log.csv", "-o", tmp_path / "d.h5").err
    assert "1 log as recorded" in said
    direct, stored = (eaid.fit(tmp_path / name) for name in ("log.csv", "d.h5"))
    assert stored.plant.kind == "lag" and stored.plant.tau1 == pytest.approx(direct.plant.tau1, rel=1e-6)
    eaid.read(tmp_path / "log.csv").save(tmp_path / "e.h5")
    assert (tmp_path / "e.h5").read_bytes() == (tmp_path / "d.h5").read_bytes()


def test_the_same_logs_give_the_same_bytes(logs, stored, tmp_path, run_eaid):
    said = ("--apparatus", "surfaces=1,inner_radius_m=0.03")
    assert run_eaid("ingest", logs, "-q", *said, "-o", tmp_path / "a.h5").code == 0
    assert run_eaid("ingest", tmp_path / "a.h5", "-q", "-o", tmp_path / "c.h5").code == 0
    assert (tmp_path / "a.h5").read_bytes() == stored.read_bytes() == (tmp_path / "c.h5").read_bytes()
    assert stored.stat().st_size < 0.5 * 4 * 2000 * 4 * 8


def test_attributes_of_the_contract(stored):
    with h5py.File(stored) as file:
        facts = {"schema": "eaid/data/1", "kind": "clutch", "input_unit": "%", "output_unit": "N·m", "surfaces": 1,
                 "inner_radius_m": 0.03, "synthetic": "made by this test"}  # fmt: skip
        assert dict(file.attrs).items() >= facts.items()
        assert [*file["runs"]] == sorted(f"u{u}_{k}{e}" for u in (30, 90) for k in (1, 2) for e in ("", "-release"))
        one, fall = file["runs/u30_2"], file["runs/u30_2-release"]
        columns = dict.fromkeys(("time_s", "input", "torque_nm", "reference_nm"), np.float64)
        assert {name: one[name].dtype for name in one} == columns
        assert (one.attrs["level"], one.attrs["repeat"], one.attrs["step_s"]) == (30.0, 2, 5.0)
        assert (one.attrs["edge"], fall.attrs["edge"], fall.attrs["step_s"]) == ("rising", "falling", 15.0)
        assert one.attrs["baseline_nm"] == pytest.approx(0.2, abs=0.002)
        assert one.attrs["source"].endswith("u30_2.csv") and len(one.attrs["sha256"]) == 64


def test_findings_and_unknown_units_survive(tmp_path):
    y = np.where(T >= 5, 1.0, 0.0) + 0.01 * np.sin(1e3 * T)
    cells = ["" if k == 100 else repr(v) for k, v in enumerate(y.tolist())]
    (tmp_path / "a.csv").write_text(text("time_s,u,y", T, np.where(T >= 5, 50, 0), cells))
    steps = eaid.read(tmp_path / "a.csv", repair=True)
    steps.save(tmp_path / "d.h5")
    again = eaid.read(tmp_path / "d.h5")
    assert again.runs[0].findings == steps.runs[0].findings
    assert {"rows-dropped", "unit-unknown"} <= {one.code for one in again.runs[0].findings}
    assert (again.input_unit, again.output_unit) == ("a.u.", "a.u.")


def by_hand(
    path: Path, damage: Callable[[Any], Any] = lambda _: None, shift: float = 0.0, plain: bool = False, **more: object
) -> Path:
    """A dataset with no more than the contract asks for. With a seal, which a script does not write, no process has to
    be started to read it."""
    with h5py.File(path, "w") if plain else hdf5_written_whole(path, force=True) as file:
        file.attrs.update({"schema": "eaid/data/1", "kind": "clutch", "input_unit": "%"})
        for name, level in (("first", 40.0), ("second", 80.0)):
            group = file.create_group(f"runs/{name}")
            group["time_s"], group["input"] = T + shift, np.where(T >= 2, level, 0.0)
            group["torque_nm"] = np.where(T >= 2, 0.04 * level * -np.expm1(-(T - 2) / 0.3), 0.0) + 0.1
            facts = {"level": level, "repeat": 1, "step_s": 2.0 + shift, "baseline_nm": 0.1}
            group.attrs.update(facts | {"source": "x", "sha256": ""} | more)
        damage(file)
    return path


def bare(file: Any) -> None:
    for name in ("first", "second"):
        for key in list(file[f"runs/{name}"].attrs):
            del file[f"runs/{name}"].attrs[key]


@pytest.mark.parametrize("damage", [bare, lambda _: None])
def test_a_users_own_dataset(damage, tmp_path):
    steps = eaid.read(by_hand(tmp_path / "d.h5", damage, plain=True))
    assert [level.level for level in steps.levels] == [40.0, 80.0] and steps.runs[0].step_s == 2.0
    np.testing.assert_allclose(steps.levels[1].mean[-1], 3.2, atol=1e-9)
    assert (steps.apparatus.surfaces, steps.synthetic, steps.output_unit) == (2, None, "N·m")


@pytest.mark.parametrize("shift", [1e6, 1e6 + 1, 1.7e9, -1.7e9])
def test_a_users_own_dataset_on_a_clock_since_1970(shift, tmp_path):
    """Stamps of 1.7e9 s cost no digit: beyond 1e6 s the run's own time begins at 0, and its instants with it."""
    begin = shift if abs(shift) > 1e6 else 0.0
    for one in eaid.read(by_hand(tmp_path / "d.h5", shift=shift, until_s=15.0 + shift), logs_as="recorded").recorded:
        assert one.time_s[[0, -1]].tolist() == pytest.approx([shift - begin, shift - begin + 19.99])
        assert (one.step_s, one.until_s, one.start_s) == pytest.approx((2 + shift - begin, 15 + shift - begin, begin))


def test_texts_of_a_users_own_dataset_may_be_bytes(tmp_path):
    def bytes_too(file: Any) -> None:
        file.attrs["input_unit"], file.attrs["surfaces"] = np.bytes_(b"V\x1b\n"), 1

    more = {"source": np.bytes_(b"bench.csv"), "edge": np.bytes_(b"rising")}
    steps = eaid.read(by_hand(tmp_path / "d.h5", bytes_too, **more))
    assert (steps.runs[0].source, steps.steps[0].edge, steps.input_unit) == ("bench.csv", "rising", "V")
    assert steps.apparatus.surfaces == 1


def sets(place: str, name: str, value: Any) -> Any:
    return lambda f: f[place].attrs.__setitem__(name, value)


AGAIN, GONE = "ingest the logs again", ("input", "torque_nm")
DAMAGED: dict[str, Any] = {
    f": its schema is 'eaid/data/9', and this eaid reads 'eaid/data/1'; {AGAIN}": sets("/", "schema", "eaid/data/9"),
    ": its kind is 'brake'; it must be one of clutch, friction-force, friction-speed": sets("/", "kind", "brake"),
    f": holds no runs; {AGAIN}": lambda f: f.__delitem__("runs"),
    f": run first has no input and no torque_nm; {AGAIN}": lambda f: [f.pop(f"runs/first/{k}") for k in GONE],
    f": run first has columns of different shape; {AGAIN}": lambda f: [f.pop("runs/first/input"),
        f["runs/first"].update(input=np.zeros(7))],
    f": run first: its level is no number; {AGAIN}": sets("runs/first", "level", "high"),
    f": run first: its findings cannot be read; {AGAIN}": sets("runs/first", "findings", "["),
    ": run first: sample 8, column input, is empty or not a number": lambda f: f["runs/first/input"].write_direct(
        np.where(T == 0.07, np.nan, 0.0)),
    ": run first: time falls at sample 8 (0 s after 0.06 s)": lambda f: f["runs/first/time_s"].__setitem__(7, 0.0),
    ": run first: the output never changes (1 N·m ": lambda f: f["runs/first/torque_nm"].__setitem__(slice(None), 1.0),
    ": run first: the input is 140 % at 3 s, above 100": lambda f: f["runs/first/input"].write_direct(140.0 * (T >= 3)),
    ": run first: the step at 99 s lies outside the log": sets("runs/first", "step_s", 99.0),
    f": its apparatus holds what is no number; {AGAIN}": sets("/", "surfaces", "two"),
    ": runs/first/link is a link to another file; copy the data into this one": lambda f: f.__setitem__(
        "runs/first/link", h5py.ExternalLink("/etc/passwd", "x")),
}  # fmt: skip


@pytest.mark.parametrize("sentence", DAMAGED)
def test_bad_datasets(sentence, tmp_path, run_eaid):
    path = by_hand(tmp_path / "d.h5", DAMAGED[sentence], plain="a link" in sentence)
    ran = run_eaid("ingest", path, "-o", tmp_path / "e.h5")
    (told,) = [line for line in ran.err.splitlines() if not line.startswith("reading logs: ")]
    assert ran.code == 3 and told.startswith(f"error: {path}{sentence}") and not (tmp_path / "e.h5").exists()


@pytest.mark.parametrize(
    ("level", "after", "told"), [(-60, 60, set()), (61.2, 60, set()), (61.3, 60, {60}), (9, np.nan, set())]
)
def test_a_stored_level_that_its_own_input_contradicts(level, after, told, tmp_path):
    def alone(file: Any) -> None:
        del file["runs/second"]
        file["runs/first/input"][:] = np.where(T >= 2, after, 0) if np.isfinite(after) else np.nan

    steps = eaid.read(by_hand(tmp_path / "d.h5", alone, level=level))
    codes = (one for run in steps.runs for one in run.findings if one.code == "level-contradicts-input")
    assert {one.values["held"] for one in codes} == told


def test_rows_of_a_dataset_are_repaired_as_those_of_a_log(tmp_path):
    path = by_hand(tmp_path / "d.h5", lambda f: f["runs/first/torque_nm"].__setitem__(40, np.nan), edge="rising")
    with pytest.raises(DataError, match="d.h5: run first: sample 41, column output, is empty or not a number"):
        eaid.read(path)
    run = eaid.read(path, repair=True).steps[0]
    assert len(run.time_s) == 1999
    assert [dict(one.values) for one in run.findings if one.code == "rows-dropped"] == [{"dropped": 1, "count": 2000}]


def test_a_change_by_another_program_is_taken(stored, tmp_path):
    path = tmp_path / "data.h5"
    path.write_bytes(stored.read_bytes())
    with h5py.File(path, "a") as file:
        file["runs/u30_1"].attrs["baseline_nm"] = 0.3
        file.attrs["texts"] = ["of", "free", "length"]
    assert {run.name: run.baseline for run in eaid.read(path).steps}["u30_1"] == 0.3
    data = path.read_bytes()  # bytes that look like a mention of a text refuse nothing
    path.write_bytes(data + (1 << 30).to_bytes(4, "little") + data.index(b"GCOL").to_bytes(8, "little") + b"\1\0\0\0")
    assert len(eaid.read(path).steps) == 8
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(DataError, match="is a damaged HDF5 file"):
        eaid.read(path)
