import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from eaid.errors import DataError, UsageError
from eaid.replay.files import write_replay
from eaid.report.results import kind_of, read_results
from eaid.results.replay import Head, Metrics, Record, Replay


def test_files_are_told_apart_by_what_they_say(files: dict[str, Path]):
    results = read_results(
        [files["multisine.h5"], files["gains.json"], files["clutch.h5"], files["clutch.json"], files["steps.h5"]]
    )
    assert [len(part) for part in (results.data, results.fits, results.gains, results.replays)] == [1, 1, 1, 2]
    assert [replay.result.head.scenario for replay in results.replays] == [
        "steps",
        "multisine",
    ]  # the paper's order, not the call's
    assert list(results.replays[0].result.records) == ["rc", "pi"]


def test_a_script_s_own_json_is_known_by_its_parts(tmp_path: Path):
    (tmp_path / "a.json").write_text(json.dumps({"linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42}}))
    (tmp_path / "b.json").write_text(json.dumps({"rc": {"K_P": 4.5}, "model": {"a0": 1.36}}))
    assert [kind_of(tmp_path / name) for name in ("a.json", "b.json")] == ["fit", "gains"]


def test_everything_that_is_no_result_is_told_at_once(tmp_path: Path):
    (tmp_path / "a.json").write_text("{")
    (tmp_path / "b.json").write_text(json.dumps({"schema": "other/1"}))
    (tmp_path / "c.txt").write_bytes(b"\xff\xfe\x00")
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["x"] = np.zeros(3)
    paths = [tmp_path / name for name in ("a.json", "b.json", "c.txt", "d.h5", "gone.json")]
    with pytest.raises(DataError) as caught:
        read_results(paths)
    wanted = "is no result of eaid; give a fit.json, gains.json, replay.h5 or data.h5"
    assert caught.value.sentences[:4] == tuple(f"{path}: {wanted}" for path in paths[:4])
    assert caught.value.sentences[4].startswith(f"{paths[4]}: no such file")


def test_a_folder_is_refused(tmp_path: Path):
    with pytest.raises(UsageError, match="is a folder; give the files in it"):
        read_results([tmp_path])


def test_a_replay_without_a_column_names_it(tmp_path: Path):
    with h5py.File(tmp_path / "replay.h5", "w") as file:
        file.attrs["schema"] = "eaid/replay/1"
        for name in ("time_s", "reference_nm", "torque_nm"):
            file[f"rc/{name}"] = np.arange(5.0)
    with pytest.raises(DataError, match="controller 'rc' has no duty_pct; make the replay again"):
        read_results([tmp_path / "replay.h5"])


def test_a_replay_by_the_contract_alone_is_enough(tmp_path: Path):
    with h5py.File(tmp_path / "replay.h5", "w") as file:
        file.attrs["schema"] = "eaid/replay/1"
        file.attrs["scenario"] = "multisine"
        for name in ("time_s", "reference_nm", "torque_nm", "duty_pct"):
            file[f"rc/{name}"] = np.linspace(0, 1, 50)
    replay = read_results([tmp_path / "replay.h5"]).replays[0].result
    assert replay.head.scenario == "multisine" and replay.records["rc"].metrics == Metrics()


def _record() -> dict[str, np.ndarray]:
    t = np.arange(20) / 1000.0
    return {"time_s": t, "reference_nm": np.ones(20), "torque_nm": np.sin(t), "duty_pct": np.full(20, 50.0)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("attribute", "value", "says"),
    [
        ("metrics", '{"steps": [3]}', r"rc: its steps\[0\] is 3 .Expected object"),
        ("metrics", '{"max_abs_error_nm": NaN}', "its metrics is no JSON"),
        ("metrics", "{", "its metrics is no JSON"),
        ("metrics", '{"modes": []}', None),
        ("band_quantiles", "x", 'its band_quantiles is "x"'),
        ("scenario", 3, "its scenario is 3"),
        ("dt_s", -1.0, "its dt_s is -1.0"),
        ("anything", "{", "its anything is no JSON"),
    ],
)
def test_what_a_replay_says_of_itself_is_checked(tmp_path: Path, attribute: str, value: object, says: str | None):
    path = tmp_path / "replay.h5"
    write_replay(path, Replay(Head("steps"), {"rc": Record(_record())}))
    with h5py.File(path, "a") as file:
        del file.attrs["digest"]
        (file["rc"] if attribute == "metrics" else file).attrs[attribute] = value
    if says is None:
        assert read_results([path]).replay("steps") is not None
        return
    with pytest.raises(DataError, match=says):
        read_results([path])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("column", "values", "says"),
    [
        ("torque_nm", np.array([b"x"] * 20), "rc: its torque_nm holds what is no number"),
        ("torque_nm", np.full(20, np.nan), "rc: its torque_nm holds what is no number"),
        ("torque_nm", np.zeros(19), "controller 'rc' has no torque_nm"),
        ("time_s", np.zeros(20), "rc: its time_s does not rise"),
        ("time_s", np.float64(1.0), "rc: its time_s is no column of two samples"),
        ("plants/band_nm", np.zeros((2, 5)), "its plants/band_nm has not a number for every quantile"),
    ],
)
def test_columns_of_a_replay_are_checked(tmp_path: Path, column: str, values: np.ndarray, says: str):
    path = tmp_path / "replay.h5"
    write_replay(path, Replay(Head("steps"), {"rc": Record({**_record()})}))
    with h5py.File(path, "a") as file:
        del file.attrs["digest"]
        if column in file["rc"]:
            del file["rc"][column]
        file["rc"][column] = values
    with pytest.raises(DataError, match=says):
        read_results([path])
