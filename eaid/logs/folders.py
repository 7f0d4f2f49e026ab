"""What a folder of logs holds: its logs, and what lies beside them in any lab: notes, pictures, models, results.

A file given by name is always read, or refused. In a folder, what plainly is no log is left out, and told in one
sentence; what looks like a log that came to harm is read, and so refused by its name.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

from eaid.errors import DataError, UsageError
from eaid.files import LOGS
from eaid.logs.columns import INPUTS, OUTPUTS, TIME
from eaid.logs.dialect import has_table, lines_of
from eaid.logs.formats import format_of, is_hdf5
from eaid.logs.units import split_name
from eaid.sealed import is_as_written
from eaid.shown import listed

SKIPPED = (
    ".md", ".txt~", ".part", ".json", ".png", ".jpg", ".jpeg", ".pdf", ".svg", ".html", ".toml", ".py", ".m", ".slx",
    ".mdl", ".yaml", ".yml", ".docx", ".pptx", ".ini",
)  # fmt: skip
"""Endings that a folder of logs also holds and that are no logs: passed over in silence."""
RECORDED = (*LOGS, ".h5", ".hdf5")
"""Endings of logs: a file with one of them is left out for no other reason than that eaid wrote it itself."""
HEAD = 1 << 16
"""Bytes of a text by which it is judged."""


def files_of(paths: Iterable[Path], tell: Callable[[str], None] = lambda _: None) -> list[Path]:
    """The files behind what the user gave: a folder stands for the logs in it, by name.

    `tell` gets a sentence about what is left out of a folder.
    """
    files: list[Path] = []
    missing: list[str] = []
    for path in paths:
        if path.is_dir():
            inside, left = _sorted_out(path)
            others = [file.name for file in left]
            if not inside:
                besides = f" (left out: {listed(others, 5)})" if others else ""
                missing.append(f"{path}: holds no logs{besides}; give the folder that does")
            elif others:
                tell(f"{path}: left out as no logs: {listed(others, 5)}; a file given by name is always read")
            files.extend(inside)
        elif path.exists():
            files.append(path)
        else:
            missing.append(f"{path}: no such file or folder; check the path")
    unnamed = [file for file in files if not _is_utf8(file)]
    missing.extend(f"{file}: its name, or that of its folder, is not UTF-8; rename it" for file in unnamed)
    if missing:
        raise DataError(*missing)
    twice = [path for path, count in Counter(file.resolve() for file in files).items() if count > 1]
    if twice:
        raise UsageError(f"{twice[0]}: is given twice; a log counts once")
    return files


def _is_utf8(path: Path) -> bool:
    try:
        return bool(str(path).encode())
    except UnicodeEncodeError:
        return False


def _sorted_out(folder: Path) -> tuple[list[Path], list[Path]]:
    """The logs of a folder, and what is left out, each by name."""
    found = sorted(
        item
        for item in folder.iterdir()
        if item.is_file()
        and not item.name.startswith(".")
        and item.suffix.lower() not in SKIPPED
        and item.name != "Thumbs.db"
    )
    kinds = {item: _made_by_eaid(item) for item in found}
    others = [item for item in found if kinds[item] == "replay" or (kinds[item] is None and plainly_no_log(item))]
    recorded = [item for item in found if kinds[item] is None and item not in others]
    if recorded:  # a dataset beside logs was most likely made from them, and a log counts once
        others = sorted([*others, *(item for item in found if kinds[item] == "data")])
    return [item for item in found if item not in others], others


def _made_by_eaid(path: Path) -> str | None:
    """data or replay, for a file that eaid wrote; None for any other."""
    try:
        with path.open("rb") as file:
            head = file.read(4096)
        if not is_hdf5(head) or not is_as_written(path):
            return None
        import h5py

        with h5py.File(path, "r", locking=False) as stored:
            schema = re.fullmatch(r"eaid/(data|replay)/\d+", str(stored.attrs.get("schema", "")))
    except (OSError, ValueError, RuntimeError, KeyError):
        return None
    return schema[1] if schema else None


def plainly_no_log(path: Path) -> bool:
    """Whether a file is of a kind that holds no record: pictures, office files, prose. When in doubt, it is a log."""
    if path.suffix.lower() in RECORDED:
        return False
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError:
        return False
    if not head:
        return False
    form = format_of(head[:4096]).name
    if form != "text":
        return form == "not read"
    lines = lines_of(head)[: -1 if len(head) == HEAD else None]
    return not has_table(lines) and not any(_is_heading(line) for line in lines[:100])


_TIMES = {name for group in TIME for name in group.names}
_OTHERS = {name for groups in (*INPUTS.values(), OUTPUTS) for group in groups for name in group.names}


def _is_heading(line: str) -> bool:
    """Whether a line names the columns of a log: a time, and an input or an output, in cells of their own."""
    cells = [cell.strip(" \"'#%") for cell in re.split(r"[,;\t|]", line)]
    names = {re.sub(r"[^a-z]", "", split_name(cell)[0].lower()) for cell in cells if len(cell) < 40}
    return bool(names & _TIMES) and bool(names & _OTHERS)
