"""Result files → `Results`: each is recognised by what it says of itself; long datasets are thinned when read."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.errors import DataError, UsageError
from eaid.files import sha256_of
from eaid.findings import Finding, say
from eaid.logs.hdf import open_hdf5
from eaid.logs.read import Hear, read_runs
from eaid.logs.run import Run
from eaid.options import ReadOptions
from eaid.replay import files as replay_files
from eaid.replay.controllers import CONTROLLERS
from eaid.report.edge_logs import is_whole
from eaid.report.results import NEEDED, Given, Results, gathered
from eaid.report.thin import as_recorded, shortened
from eaid.results import codec
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay
from eaid.steps.build import build_stepset
from eaid.steps.stepset import StepSet


def read_results(paths: Sequence[Path], tell: Callable[[str], None] = lambda _: None) -> Results:
    """Read and sort any number of result files; all that cannot be read are told at once.

    `tell` gets a sentence for each part of a file that is left out.
    """
    items: list[Given[Any]] = []
    faults: list[str] = []
    for path in paths:
        try:
            kind = kind_of(path)
            result, found = _READERS[kind](path)
            items.append(Given(result, str(path), sha256_of(path)))
            for one in found:
                tell(say(one))
        except DataError as fault:
            faults.extend(fault.sentences)
    if faults:
        raise DataError(*faults)
    return gathered(items)


def kind_of(path: Path) -> str:
    """fit, gains, replay, data or couple, by what the file says of itself; anything else is refused."""
    if path.is_dir():
        raise UsageError(f"{path}: is a folder; give the files in it that eaid wrote")
    if not path.is_file():
        raise DataError(f"{path}: no such file; give a fit.json, gains.json, replay.h5 or data.h5 that eaid wrote")
    if h5py.is_hdf5(path):
        with open_hdf5(path, str(path)) as file:
            said = file.attrs.get("schema")
            schema = str(said if said is not None else "eaid/data/1" if "runs" in file else "")
    else:
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except (ValueError, RecursionError):  # no UTF-8, no JSON, or numbers and nesting beyond all reason
            content = None
        schema = str(content.get("schema", _by_its_parts(content))) if isinstance(content, dict) else ""
    known = {f"eaid/{kind}/1": kind for kind in ("fit", "gains", "replay", "data", "couple")}
    if schema not in known:
        raise DataError(f"{path}: is no result of eaid; give a fit.json, gains.json, replay.h5 or data.h5")
    return known[schema]


def _by_its_parts(content: Mapping[str, object]) -> str:
    """The schema of a file of the user's own script that names none."""
    return next((f"eaid/{kind}/1" for kind, parts in codec.KINDS.items() if any(part in content for part in parts)), "")


def _read_data(path: Path) -> tuple[StepSet, tuple[Finding, ...]]:
    every: dict[str, int] = {}
    with open_hdf5(path, str(path)) as file:
        count = max(1, len(file.get("runs", ())))

    def short(run: Run) -> Run:
        run, every[run.name] = shortened(run, count)
        return run

    runs = read_runs([path], hear=Hear(run=short))
    whole = tuple(run for run in runs if is_whole(run))
    if len(whole) < len(runs):
        steps = as_recorded(build_stepset([run for run in runs if not is_whole(run)], ReadOptions()), every)
        return replace(steps, recorded=whole), ()
    first = whole[0]
    rig = first.apparatus or Apparatus()
    return StepSet(
        first.kind or "clutch", first.input_unit, first.output_unit, rig, (), recorded=whole, synthetic=first.synthetic
    ), ()


def _read_replay(path: Path) -> tuple[Replay, tuple[Finding, ...]]:
    """A replay.h5 whose groups can be drawn; one without its columns, or with a time that does not rise, is refused."""
    replay, found = replay_files.read(path)
    drawn = {name: one for name, one in replay.records.items() if set(NEEDED) & set(one.columns) != {"time_s"}}
    faults = []
    for name, one in drawn.items():
        t = one.columns["time_s"]
        if missing := [key for key in NEEDED if key not in one.columns]:
            faults.append(f"{path}: controller {name!r} has no {', '.join(missing)}; make the replay again")
        elif not (t[1:] > t[:-1]).all():
            faults.append(f"{path}: {name}: its time_s does not rise from sample to sample; make the replay again")
        elif fault := _band_fault(one.tables, len(replay.head.band_quantiles)):
            faults.append(f"{path}: {name}: {fault}")
    if faults:
        raise DataError(*faults)
    if not drawn:
        raise DataError(f"{path}: holds no controller; make it again with eaid simulate")
    known = {name: i for i, name in enumerate(CONTROLLERS)}
    ordered = dict(sorted(drawn.items(), key=lambda item: known.get(item[0], len(known))))
    return replace(replay, records=ordered), found


def _band_fault(tables: Mapping[str, Array], quantiles: int) -> str | None:
    """What is wrong with the outputs of drawn plants: they have a row a quantile and a column an instant."""
    if "plants/band_nm" not in tables:
        return None
    band, time = tables["plants/band_nm"], tables.get("plants/band_time_s")
    wanted = None if time is None else (quantiles, *time.shape)
    if band.shape == wanted and all(part.dtype.kind in "fiu" for part in (band, time) if part is not None):
        return None
    return "its plants/band_nm has not a number for every quantile and instant; make the replay again"


_READERS: Mapping[str, Callable[[Path], tuple[Any, tuple[Finding, ...]]]] = {
    "fit": partial(codec.read, kind="fit", type_=Fit),
    "gains": partial(codec.read, kind="gains", type_=Gains),
    "couple": partial(codec.read, kind="couple", type_=Coupling),
    "replay": _read_replay,
    "data": _read_data,
}
