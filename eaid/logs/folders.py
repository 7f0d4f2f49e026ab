"""What a folder of logs holds: its logs, and what lies beside them in any lab: notes, pictures, models, results.

A file given by name is always read, or refused. In a folder, files with the ending of a log are logs, and so are others
that hold rows of numbers; the rest is left out, and told in one sentence.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

from eaid.errors import DataError, UsageError
from eaid.files import LOGS, is_as_written
from eaid.logs.formats import format_of
from eaid.logs.table import plain
from eaid.logs.text import has_table, lines_of
from eaid.shown import listed

# Endings that a folder of logs also holds and that are no logs: passed over in silence
SKIPPED = (
    ".md", ".txt~", ".part", ".json", ".png", ".jpg", ".jpeg", ".pdf", ".svg", ".html", ".toml", ".py", ".m", ".slx",
    ".mdl", ".yaml", ".yml", ".docx", ".pptx", ".ini",
)  # fmt: skip
HEAD_BYTES = 1 << 16  # Bytes of a text by which it is judged


def files_of(paths: Iterable[Path], tell: Callable[[str], None] = lambda _: None) -> list[Path]:
    """The files behind what the user gave, a folder for the logs in it; `tell` gets a sentence of what is left out."""
    files: list[Path] = []
    faults: list[str] = []
    for path in paths:
        if path.is_dir():
            inside, others = _sorted_out(path)
            if not inside:
                besides = f" (left out: {listed(others, 5)})" if others else ""
                faults.append(f"{path}: holds no logs{besides}; give the folder that does")
            elif others:
                tell(f"{path}: left out as no logs: {listed(others, 5)}; a file given by name is always read")
            files.extend(inside)
        elif path.exists():
            files.append(path)
        else:
            faults.append(f"{path}: no such file or folder; check the path")
    for file in files:
        if str(file).encode(errors="replace").decode() != str(file):
            faults.append(f"{file}: its name, or that of its folder, is not UTF-8; rename it")
        elif not str(file).isprintable():
            faults.append(f"{plain(str(file))}: its name, or that of its folder, holds characters that no one sees; "
                          f"rename it")  # fmt: skip
    if faults:
        raise DataError(*faults)
    twice = [path for path, count in Counter(file.resolve() for file in files).items() if count > 1]
    if twice:
        raise UsageError(f"{twice[0]}: is given twice; a log counts once")
    return files


def _sorted_out(folder: Path) -> tuple[list[Path], list[str]]:
    """The logs of a folder, and the names of what is left out, each in order."""
    kinds = {
        item: _kind(item)
        for item in sorted(folder.iterdir())
        if item.is_file() and item.name[0] != "." and item.suffix.lower() not in SKIPPED and item.name != "Thumbs.db"
    }
    # a dataset beside logs was most likely made from them, a workbook holds their results; a log counts once
    wanted = next((kind for kind in ("log", "Excel") if kind in kinds.values()), "data")
    return [item for item in kinds if kinds[item] == wanted], [item.name for item in kinds if kinds[item] != wanted]


def _kind(path: Path) -> str:
    """log, Excel, data or replay of a file in a folder, by its ending, first bytes, or rows of numbers in a text."""
    ending = path.suffix.lower()
    if ending in LOGS:
        return "log"
    try:
        if is_as_written(path):
            import h5py

            with h5py.File(path, "r", locking=False) as file:
                return str(file.attrs["schema"]).split("/")[1]
        with path.open("rb") as raw:
            head = raw.read(HEAD_BYTES)
    except OSError:
        return "log"  # refused by its name
    form = format_of(head[:4096]).name
    if form == "Excel":
        return form
    rows = has_table(lines_of(head)) if form == "text" else form != "not read"
    return "log" if rows or ending in (".h5", ".hdf5") else ""
