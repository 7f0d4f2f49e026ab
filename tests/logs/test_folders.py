"""A folder of logs with what lies beside them in a lab: notes are left out and named, damaged logs are not."""

import shutil
from pathlib import Path

import pytest

from eaid.cli.main import run
from eaid.logs.folders import files_of, plainly_no_log

LOG = "time_s,duty_pct,torque_nm\n" + "".join(
    f"{k / 10},{0 if k < 20 else 50},{0.0 if k < 20 else 2 - 1.7 ** (20 - k):.6f}\n" for k in range(100)
)
PROSE = "Session of 3 May, rig 2.\nDisc 3 was changed after run 7, and run 12 is odd: 20 % came late.\n\nAsk Anna.\n"

BESIDE: dict[str, bytes] = {
    "notes.txt": PROSE.encode(),
    "README": b"# Logs\n\nRecorded with QuaRC at 1 kHz.\n",
    "liesmich.txt": "Übung 1: Größe der Last, 3 kg.\n".encode("latin-1"),
    "notes16.txt": PROSE.encode("utf-16"),
    "to do.log": b"1. clean discs\n2. check the belt\n3. call\n",
    "people.txt": b"name\tmail\nAnna\tanna@lab\nBen\tben@lab\n",
    "rig.jpeg2": b"\xff\xd8\xff\xe0 picture",
    "paper": b"%PDF-1.7 paper",
    "model.slxc": b"PK\x03\x04 a Simulink cache",
    "results.xlsx": b"PK\x03\x04 a workbook",
    "old.xls": b"\xd0\xcf\x11\xe0 a workbook",
    "firmware.bin": bytes(range(256)) * 8,
    "setup.vi": b"RSRC\r\n\x00\x03LVINLBVW" + bytes(100),
}
"""Each named in the warning and left out."""
SILENT = ["notes.md", "picture.png", "script.m", "model.slx", ".DS_Store", "Thumbs.db", "desktop.ini", ".notes.txt.swp"]
DAMAGED: dict[str, bytes] = {
    "a.csv": b"",
    "b.txt": b"time_s\tduty_pct\ttorque_nm\n",
    "c.csv": b"time_s,duty_pct,torque_nm\n0,0,0\n1,0,0\n",
    "d.csv": PROSE.encode(),
    "e.csv": b"PK\x03\x04 a workbook that was called CSV",
    "f.mat": bytes(3000),
    "g.csv": bytes(3000),
    "h.txt": LOG.replace("3.5,", "3.5x,").encode(),
    "i.txt": b"Zeit;Tastgrad;Drehmoment\r\nx;y;z\r\n",
    "j.txt": b"0 0 0\n" * 50,
    "k.tdms": b"TDSm" + bytes(10),
}
"""What looks like a log that came to harm: read, and so refused by its name."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "logs"
    made.mkdir()
    (made / "run1.csv").write_text(LOG)
    return made


def ingest(folder: Path, *more: str) -> int:
    return run(["ingest", str(folder), "-q", "--force", "-o", str(folder.parent / "d.h5"), *more])


@pytest.mark.parametrize("name", BESIDE)
def test_what_plainly_is_no_log_is_named_and_left_out(
    folder: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    (folder / name).write_bytes(BESIDE[name])
    told: list[str] = []
    assert files_of([folder], told.append) == [folder / "run1.csv"]
    assert told == [f"{folder}: left out as no logs: {name}; a file given by name is always read"]
    assert ingest(folder) == 0
    assert run(["ingest", str(folder), str(folder / name), "-q", "-o", str(folder.parent / "e.h5")]) == 3
    assert str(folder / name) in capsys.readouterr().err  # given by name it is refused


def test_one_warning_names_them_all(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, content in BESIDE.items():
        (folder / name).write_bytes(content)
    for name in SILENT:
        (folder / name).write_bytes(b"1,2,3\n" * 10)
    assert run(["ingest", str(folder), "-o", str(folder.parent / "d.h5")]) == 0
    warnings = [line for line in capsys.readouterr().err.splitlines() if "left out" in line]
    assert warnings == [
        f"warning: {folder}: left out as no logs: README, firmware.bin, liesmich.txt, model.slxc, notes.txt "
        f"and {len(BESIDE) - 5} more; a file given by name is always read"
    ]


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_log_in_a_folder_is_refused_by_name(
    folder: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    (folder / name).write_bytes(DAMAGED[name])
    assert not plainly_no_log(folder / name)
    assert ingest(folder) == 3
    assert f"error: {folder / name}: " in capsys.readouterr().err


def test_a_folder_without_a_log_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "notes.txt").write_text(PROSE)
    (tmp_path / "logs" / "notes.md").write_text(PROSE)
    assert ingest(tmp_path / "logs") == 3
    said = f"error: {tmp_path / 'logs'}: holds no logs (left out: notes.txt); give the folder that does\n"
    assert capsys.readouterr().err == said


def test_what_eaid_made_of_the_logs_does_not_count_again(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`eaid ingest . -o data.h5` twice gives one repeat, not two."""
    shutil.copy(folder / "run1.csv", folder / "run2.csv")
    for _ in range(2):
        assert run(["ingest", str(folder), "-o", str(folder / "data.h5"), "--force"]) == 0
    assert capsys.readouterr().err.count("left out as no logs: data.h5") == 1
    assert files_of([folder]) == [folder / "run1.csv", folder / "run2.csv"]
    for name in ("run1.csv", "run2.csv"):
        (folder / name).unlink()
    assert files_of([folder]) == [folder / "data.h5"]  # alone it is what is meant


@pytest.mark.parametrize(
    "text",
    [
        LOG,
        LOG.replace(",", ";").replace(".", ","),
        LOG.replace(",", "\t"),
        "\n".join(line.split(",")[2] for line in LOG.splitlines()),
        "Channel 1\n" * 40 + LOG,
        '"' + LOG.replace(",", '","').replace("\n", '"\n"'),
        LOG.replace(",", " | "),
        "2026-05-03 10:00:00.1 1.5\n" * 20,
        "nan,nan,nan\n" * 20,
    ],
)
def test_tables_of_all_kinds_are_logs(tmp_path: Path, text: str) -> None:
    path = tmp_path / "log.txt"
    path.write_text(text)
    assert not plainly_no_log(path)
    path.write_bytes(text.encode("utf-16"))
    assert not plainly_no_log(path)


def test_every_recorded_file_of_the_formats_is_a_log(tmp_path: Path) -> None:
    shared = Path(__file__).parents[2] / "../shared/realdata"
    if not shared.is_dir():
        pytest.skip("the recorded logs are not here")
    files = [path for path in shared.rglob("*") if path.is_file() and path.suffix.lower() in (".csv", ".mat", ".tdms")]
    assert len(files) > 10
    assert [path for path in files if path.stat().st_size and plainly_no_log(path)] == []
