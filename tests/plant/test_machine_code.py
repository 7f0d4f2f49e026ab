"""Machine code on disk: never that of other sources, and none where no folder may be written to."""

import pickle
from pathlib import Path

import pytest

from eaid.plant.machine_code import compiled, fingerprint


def twice(x: float) -> float:
    return 2.0 * x


def test_code_of_other_sources_is_never_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What another version left, with classes that are gone, would break numba where it reads it."""
    source, kept = tmp_path / "one.py", tmp_path / "kept"
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(kept))
    name, found = twice.__qualname__, list[Path]()
    for text in ("first", "second"):
        source.write_text(text)
        twice.__qualname__ = name
        assert compiled(twice, fingerprint([source]))(1.5) == 3.0
        for index in set(kept.rglob("*.nbi")) - set(found):
            found.append(index)
            index.write_bytes(pickle.dumps("of another numba")[:-1])  # ends in the middle
    assert len(found) == 2


def test_without_a_folder_it_is_compiled_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("numba.core.caching.CompileResultCacheImpl._locator_classes", [])
    assert compiled(lambda x: 2.0 * x, "0")(1.5) == 3.0
