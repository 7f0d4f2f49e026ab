"""docs/how-to/many-rigs.md: a folder of rigs by an engine, the same bytes as one by one."""

from pathlib import Path

import pytest

import eaid


def fit_rig(folder: Path) -> "eaid.results.fit.Fit":
    return eaid.fit(folder, ci="robust")


def test_two_workers_write_the_same_bytes_as_a_loop(tmp_path: Path) -> None:
    distributed = pytest.importorskip("dask.distributed")
    folders = []
    for seed in range(4):
        folder = tmp_path / f"rig-{seed}"
        folder.mkdir()
        eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=seed).save(folder / "data.h5")
        folders.append(folder)
        fit_rig(folder).save(folder / "loop.json")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, processes=True) as cluster,
        distributed.Client(cluster) as client,
    ):
        fits = client.gather(client.map(fit_rig, folders))
    for folder, fit in zip(folders, fits, strict=True):
        fit.save(folder / "dask.json")
        assert (folder / "dask.json").read_bytes() == (folder / "loop.json").read_bytes()
    assert len({(folder / "loop.json").read_bytes() for folder in folders}) == 4
