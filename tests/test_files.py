"""Outputs are whole or not there, and never overwritten by accident."""

from pathlib import Path

import pytest

from eaid.errors import UsageError
from eaid.files import sha256_of, written_whole


def test_a_finished_block_leaves_the_file_alone_in_its_folder(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    with written_whole(target) as part:
        part.write_text("new")
        assert not target.exists()
    assert target.read_text() == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["fit.json"]


def test_a_failure_keeps_the_earlier_result_and_leaves_no_part(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    target.write_text("old")
    with pytest.raises(RuntimeError), written_whole(target, force=True) as part:
        part.write_text("half")
        raise RuntimeError
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["fit.json"]


def test_an_existing_output_is_left_alone_without_force(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    target.write_text("old")
    with pytest.raises(UsageError, match="exists already; give --force"), written_whole(target):
        pass
    assert target.read_text() == "old"


def test_an_output_that_appears_meanwhile_is_left_alone_too(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    with pytest.raises(UsageError, match="exists already"), written_whole(target) as part:
        part.write_text("ours")
        target.write_text("theirs")
    assert target.read_text() == "theirs"


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="the folder .* does not exist"), written_whole(tmp_path / "no" / "fit.json"):
        pass


def test_sha256_is_the_known_one_of_abc(tmp_path: Path) -> None:
    (tmp_path / "abc").write_bytes(b"abc")
    assert sha256_of(tmp_path / "abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
