"""What a report shows: fits, gains, replays and datasets, from files or from memory. Nothing is refitted."""

import contextlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

import h5py

from eaid.declared import given_options
from eaid.errors import DataError, UsageError
from eaid.files import sha256_of
from eaid.findings import Finding, say
from eaid.levels.tails import as_fitted
from eaid.options import CONTROLLERS, ReadOptions
from eaid.progress import Progress, no_progress
from eaid.reading import read_steps
from eaid.report.rig import SCENARIO_NAMES, of_the_paper
from eaid.results import codec, replay_file
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains, of_another_fit
from eaid.results.models import FittedData
from eaid.results.replay import COLUMNS, Replay
from eaid.sessions.compare import Comparison
from eaid.sessions.rig import Rig
from eaid.steps.stepset import StepSet

TYPES: dict[str, Any] = {
    "fit": Fit, "gains": Gains, "replay": Replay, "data": StepSet, "couple": Coupling, "rig": Rig,
    "compare": Comparison,
}  # fmt: skip
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Given(Generic[T]):
    """A result and where it comes from."""

    result: T
    path: str  # What the result is called: its file, as given
    sha256: str = ""
    of_fit: bool = False  # Whether nobody gave it: the logs behind a fit


@dataclass(frozen=True, eq=False)
class Results:
    """All that a page shows, in the order in which it was given."""

    fits: tuple[Given[Fit], ...] = ()
    gains: tuple[Given[Gains], ...] = ()
    replays: tuple[Given[Replay], ...] = ()
    data: tuple[Given[StepSet], ...] = ()
    couplings: tuple[Given[Coupling], ...] = ()
    rigs: tuple[Given[Rig], ...] = ()
    comparisons: tuple[Given[Comparison], ...] = ()

    @property
    def main_kind(self) -> str | None:
        """The kind that the page is about: the clutch where there is one."""
        return next(iter(self.kinds), None)

    def of_kind(self, kind: str | None) -> "Results":
        """The same with fits and data of one kind alone."""
        fits = tuple(one for one in self.fits if one.result.data.kind == kind)
        return replace(self, fits=fits, data=tuple(one for one in self.data if one.result.kind == kind))

    @property
    def main_fit(self) -> Fit | None:
        """The first fit of that kind."""
        return self.fit(self.main_kind)

    @property
    def main_data(self) -> StepSet | None:
        """The first dataset of that kind that holds steps from rest."""
        return self.data_of(self.main_kind)

    @property
    def about(self) -> FittedData | StepSet | None:
        """What says of the page's own kind how it was recorded."""
        return self.main_fit.data if self.main_fit is not None else self.main_data

    @property
    def of_paper(self) -> bool:
        """Whether the page's own kind was recorded as the paper's was."""
        return self.main_kind is None or of_the_paper(self.about)

    def fit(self, kind: str | None) -> Fit | None:
        """The first fit of a kind."""
        return next((one.result for one in self.fits if one.result.data.kind == kind), None)

    def data_of(self, kind: str | None) -> StepSet | None:
        """The first dataset of a kind that holds steps from rest, which is what figures of levels show, without what
        its fit is without."""
        found = next((one.result for one in self.data if one.result.kind == kind and one.result.levels), None)
        fit = self.fit(kind)
        return found if found is None or fit is None else as_fitted(found, fit)

    def replay(self, scenario: str) -> Replay | None:
        """The first replay of a scenario."""
        return next((one.result for one in self.replays if one.result.head.scenario == scenario), None)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of experiment that fits or datasets show, the clutch first."""
        found = {one.result.data.kind for one in self.fits} | {one.result.kind for one in self.data}
        return tuple(kind for kind in EXPERIMENT_NAMES if kind in found)

    @property
    def synthetic(self) -> str | None:
        """What made the data, where any of them are not recorded; None where all come from a rig."""
        said = [one.result.data.synthetic for one in self.fits] + [one.result.synthetic for one in self.data]
        said += [one.result.head.synthetic for one in self.replays]
        return next((str(one) for one in said if one), None)


# Kind of experiment → how it is called
EXPERIMENT_NAMES = {
    "clutch": "clutch", "friction-force": "friction over force", "friction-speed": "friction over speed",
}  # fmt: skip


def gathered(items: Iterable[Any], progress: Progress = no_progress) -> Results:
    """Results in memory as a report takes them: each gets a name by its kind, replays the order of the paper."""
    sorted_: dict[str, list[Given[Any]]] = {kind: [] for kind in TYPES}
    for item in items:
        result = item.result if isinstance(item, Given) else item
        kind = next((name for name, type_ in TYPES.items() if isinstance(result, type_)), None)
        if kind is None:
            raise UsageError(f"a {type(result).__name__} is no result that a report can show")
        name = f"{kind} {len(sorted_[kind]) + 1}" if sorted_[kind] else kind
        sorted_[kind].append(item if isinstance(item, Given) else Given(result, name))
    sorted_["replay"].sort(key=lambda one: [*SCENARIO_NAMES, one.result.head.scenario].index(one.result.head.scenario))
    given = {one.result.kind for one in sorted_["data"]}
    for one in sorted_["fit"]:  # the first of each kind, which the page is about
        if one.result.data.kind not in given and (steps := steps_behind(one.result, progress)) is not None:
            sorted_["data"].append(Given(steps, f"the logs behind {one.path}", of_fit=True))
        given.add(one.result.data.kind)
    return Results(*map(tuple, sorted_.values()))


def steps_behind(fit: Fit, progress: Progress) -> StepSet | None:
    """The steps behind a fit: those in memory, else read again where its logs still are what they were; None: gone."""
    if fit.samples.steps is not None:
        return fit.samples.steps
    logs = {Path(one.path): one.sha256 for one in fit.data.inputs or fit.data.sources}
    unchanged = all(path.is_file() and sha256_of(path) == sha256 for path, sha256 in logs.items())
    if logs and fit.data.repeats and unchanged:
        with contextlib.suppress(DataError):
            return read_steps([*logs], given_options(ReadOptions, None, fit.options.reading), progress)[1]
    return None


def read_results(paths: Sequence[Path], tell: Callable[[str], None], progress: Progress) -> Results:
    """Read and sort any number of result files, all faults at once; `tell` hears of each part that is left out."""
    items: list[Given[Any]] = []
    faults: list[str] = []
    for path in paths:
        try:
            result, found = read_result(path)
            shown = drawable_replay(result, path) if isinstance(result, Replay) else result
            items.append(Given(shown, str(path), sha256_of(path)))
            for one in found:
                tell(say(one))
        except DataError as fault:
            faults.extend(fault.sentences)
    if faults:
        raise DataError(*faults)
    fits = [one.sha256 for one in items if isinstance(one.result, Fit)]
    for gains in (one.result for one in items if isinstance(one.result, Gains) and fits):
        others = [of_another_fit(gains, sha256) for sha256 in fits]
        if all(others):
            tell(say(others[0][0]))
    return gathered(items, progress)


def read_result(path: Path) -> tuple[Any, tuple[Finding, ...]]:
    """A result of any kind, by what its file says of itself, and findings about what of it was left out."""
    if path.is_dir():
        raise UsageError(f"{path}: is a folder; give the files in it that eaid wrote")
    if not path.is_file():
        raise DataError(f"{path}: no such file; give a fit.json, gains.json, couple.json, replay.h5 or data.h5")
    if not h5py.is_hdf5(path):
        kind = codec.kind_of_file(path)
        if kind not in TYPES:
            raise DataError(f"{path}: is a {kind}.json; give a fit.json, gains.json or couple.json")
        return codec.read_as(path, TYPES[kind])
    schema = ""
    with contextlib.suppress(OSError, KeyError, RuntimeError), h5py.File(path) as file:  # damaged: its reader says so
        schema = file.attrs.get("schema", "")
    if schema == replay_file.REPLAY_SCHEMA:
        return replay_file.read_replay_file(path)
    return read_steps([path], ReadOptions())[1], ()


def drawable_replay(replay: Replay, path: Path) -> Replay:
    """The groups of a replay.h5 that can be drawn; without its columns, or with a falling time, it is refused."""
    drawn = {name: one for name, one in replay.records.items() if set(COLUMNS) & set(one.columns) != {"time_s"}}
    faults = []
    for name, one in drawn.items():
        t = one.columns["time_s"]
        if missing := [key for key in COLUMNS if key not in one.columns]:
            faults.append(f"{path}: controller {name!r} has no {', '.join(missing)}; make the replay again")
        elif not (t[1:] > t[:-1]).all():
            faults.append(f"{path}: {name}: its time_s does not rise from sample to sample; make the replay again")
    if faults:
        raise DataError(*faults)
    if not drawn:
        raise DataError(f"{path}: holds no controller; make it again with eaid simulate")
    order = sorted(drawn, key=lambda name: [*CONTROLLERS, name].index(name))
    return replace(replay, records={name: drawn[name] for name in order})
