"""Replays of other kinds: drawn plants, a log's own duty, a reference of the user's own."""

from pathlib import Path

import numpy as np
import pytest

from eaid.cli.main import run
from eaid.report.figures.replays import bands
from eaid.report.results import read_results


@pytest.fixture(scope="module")
def page_of(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("replays")

    def made(name: str, *more: str) -> tuple[Path, str]:
        path = folder / f"{name}.h5"
        simulate = [
            "simulate",
            str(files["clutch.json"]),
            "--gains",
            str(files["gains.json"]),
            *more,
            "-o",
            str(path),
            "-q",
        ]
        assert run(simulate) == 0
        out = folder / name
        assert run(["report", str(files["clutch.json"]), str(path), "-o", str(out), "-q"]) == 0
        return path, (out / "report.html").read_text(encoding="utf-8")

    return made


@pytest.mark.slow
def test_drawn_plants_give_a_band_and_a_table(page_of):
    path, text = page_of("plants", "--scenario", "multisine", "--duration", "6", "--plants", "3")
    replay = read_results([path]).replays[0].result
    t, low, high = bands(replay)["rc"]
    assert t.shape == low.shape == high.shape and np.all(low <= high)
    assert "Over drawn plants: multisine" in text and "RC: largest |error| (N·m)" in text
    assert 'id="fig12_multisine"' in text and 'id="guarantee_in_replay"' in text


@pytest.mark.slow
def test_a_log_is_shown_beside_the_model(page_of, files: dict[str, Path]):
    _path, text = page_of("log", "--log", str(files["clutch.h5"]))
    assert 'id="log_replay"' in text
    assert "Recorded input through the model" in text and "synthetic-clutch-100.0-r2" in text


@pytest.mark.slow
def test_a_reference_of_ones_own_has_its_figure(page_of, tmp_path: Path):
    reference = tmp_path / "mine.csv"
    reference.write_text("time_s,reference_nm\n0,0\n1,1\n3,1\n")
    _path, text = page_of("own", "--reference", str(reference))
    assert 'id="own_reference"' in text and "Replay: reference of your own" not in text.split("<h3>")[0]
    assert f"--reference {reference}" in text
