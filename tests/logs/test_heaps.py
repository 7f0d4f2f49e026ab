"""Global heaps of HDF5: a heap whose free space is wrong makes the HDF5 library go round for ever."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from eaid.errors import DataError
from eaid.logs.dataset import read_dataset
from eaid.logs.heaps import check_heaps


def made(path: Path, texts: int = 3) -> bytearray:
    with h5py.File(path, "w") as file:
        file.attrs["schema"] = "eaid/data/1"
        for i in range(texts):
            file.attrs[f"text {i}"] = "x" * i
        file["a"] = np.array(["word" * n for n in range(2000)], dtype=h5py.string_dtype())
    return bytearray(path.read_bytes())


def test_heaps_as_the_library_writes_them(tmp_path: Path) -> None:
    for texts in (0, 1, 7, 60):
        assert made(tmp_path / "a.h5", texts).count(b"GCOL") >= 1
        check_heaps(tmp_path / "a.h5", "a.h5")


@pytest.mark.parametrize("size", [0, 8, 2928, 1 << 40])
def test_free_space_that_does_not_fill_the_heap(tmp_path: Path, size: int) -> None:
    path = tmp_path / "a.h5"
    data = made(path)
    start = data.find(b"GCOL\x01\0\0\0")
    at = start + 16
    while int.from_bytes(data[at : at + 2], "little"):
        length = int.from_bytes(data[at + 8 : at + 16], "little")
        at += 16 + length + -length % 8
    data[at + 8 : at + 16] = size.to_bytes(8, "little")
    path.write_bytes(data)
    sentence = r"a\.h5: is a damaged HDF5 file \(its heap of texts\); copy or save it again"
    with pytest.raises(DataError, match=sentence):
        read_dataset(path, "a.h5", "")


def test_a_heap_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    data = made(path)
    path.write_bytes(data[: data.find(b"GCOL") + 40])
    with pytest.raises(DataError, match="its heap of texts"):
        check_heaps(path, "a.h5")
