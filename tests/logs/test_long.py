"""Long logs: read piece by piece, every bad cell in its own row."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from eaid.logs.options import ReadOptions

from eaid.errors import DataError
from eaid.logs import text
from eaid.logs.read import read_runs

ROWS = 30_000


@pytest.fixture
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything comes in small pieces."""
    monkeypatch.setattr(text, "PIECE_BYTES", 5000)


def lines(noise: float = 0.01) -> list[str]:
    t = np.arange(ROWS) / 1000.0
    u = np.where((t >= 5) & (t < 20), 50, 0)
    rise = np.where(t >= 5, 1 - np.exp(-(t - 5).clip(0) / 0.5), 0) * np.where(t >= 20, np.exp(-(t - 20).clip(0)), 1)
    y = 2 * rise + 0.1 + noise * np.random.default_rng(1).normal(size=ROWS)
    return ["time_ms,duty_pct,torque_nm"] + [f"{1000 * a:.0f},{b},{c:.7f}" for a, b, c in zip(t, u, y, strict=True)]


def write(path: Path, rows: list[str], packed: bool = False) -> Path:
    content = ("\n".join(rows) + "\n").encode()
    path.write_bytes(gzip.compress(content) if packed else content)
    return path


@pytest.mark.parametrize("packed", [False, True], ids=["plain", "gzip"])
def test_pieces_give_the_same_run(tmp_path: Path, request: pytest.FixtureRequest, packed: bool) -> None:
    log = write(tmp_path / "a.csv", lines(), packed)
    (whole,) = read_runs([log])
    request.getfixturevalue("small_pieces")
    (pieces,) = read_runs([log])
    for name in ("time_s", "input", "output"):
        np.testing.assert_array_equal(getattr(pieces, name), getattr(whole, name))


@pytest.mark.usefixtures("small_pieces")
def test_bad_cells_are_told_by_their_own_row(tmp_path: Path) -> None:
    rows = lines()
    rows[17_000] = "16999,50"
    rows[23_456] = "23455,0,high"
    rows.insert(9_000, "# a pause\n")  # one comment and one blank line shift what follows by two
    log = write(tmp_path / "a.csv", rows)
    with pytest.raises(DataError) as caught:
        read_runs([log])
    assert [said.split(": ")[1].split(";")[0] for said in caught.value.sentences] == [
        "row 17003 has 2 cells, unlike the others",
        "row 23459, column torque_nm, holds 'high', which is no number",
    ]
    (run,) = read_runs([log], ReadOptions(repair=True))
    assert [(one.code, one.values) for one in run.findings] == [("rows-dropped", {"dropped": 2, "count": 30000})]
    assert len(run.time_s) == ROWS - 2


@pytest.mark.usefixtures("small_pieces")
def test_a_falling_time_across_pieces(tmp_path: Path) -> None:
    rows = lines()
    del rows[20_001]
    rows.insert(20_300, lines()[20_001])
    with pytest.raises(DataError, match=r"time falls at row 20301 \(20 s after 20\.299 s\)"):
        read_runs([write(tmp_path / "a.csv", rows)])


@pytest.mark.usefixtures("small_pieces")
def test_progress_is_told(tmp_path: Path) -> None:
    heard: list[float] = []
    read_runs([write(tmp_path / "a.csv", lines())], ReadOptions(tell=lambda _, share: heard.append(share)))
    assert len(heard) > 50 and heard[-1] == 1.0
    np.testing.assert_allclose(heard, np.linspace(heard[0], 1.0, len(heard)), atol=2 * heard[0])  # piece by piece
    assert heard[0] < 0.02
    packed = write(tmp_path / "a.csv.gz", lines(), packed=True)
    heard.clear()
    read_runs([packed], ReadOptions(tell=lambda _, share: heard.append(share)))
    assert heard == sorted(heard) and heard[-1] == 1.0 and heard[0] < 1.0  # never more, though it unpacks to more


@pytest.mark.usefixtures("small_pieces")
def test_a_cut_off_gzip_is_told(tmp_path: Path) -> None:
    log = write(tmp_path / "a.csv.gz", lines(), packed=True)
    log.write_bytes(log.read_bytes()[:-1000])
    with pytest.raises(DataError, match="is no whole gzip file"):
        read_runs([log])
