"""Results → a page, source for a rig; and result files back to results."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py

from eaid.api.given import chosen
from eaid.api.logs import read
from eaid.errors import DataError
from eaid.results import codec
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay
from eaid.steps.stepset import StepSet

if TYPE_CHECKING:
    from eaid.export.export import ExportFolder
    from eaid.export.options import ExportOptions


def report(
    results: "Sequence[Fit | Gains | Replay | StepSet | Coupling]",
    output_dir: str | os.PathLike[str],
    **options: Any,
) -> Path:
    """Write one self-contained page, and the figures, of any results; returns the page's path.

    Examples
    --------
    >>> import eaid, pathlib, tempfile
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> page = eaid.report([fit], pathlib.Path(tempfile.mkdtemp()) / "report")
    >>> page.name
    'report.html'
    """
    from eaid.report.options import ReportOptions
    from eaid.report.write import write_report

    return write_report(list(results), output_dir, chosen(ReportOptions, None, options)).page


def export(
    gains: Gains | None,
    output_dir: "str | os.PathLike[str] | None" = None,
    fit: Fit | None = None,
    options: "ExportOptions | None" = None,
    **keywords: Any,
) -> "ExportFolder":
    """Controllers and plant as source for a rig, with test vectors and a check program; fields of `ExportOptions`.

    Examples
    --------
    >>> import eaid, pathlib, tempfile
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> gains = eaid.tune_rc(fit)
    >>> made = eaid.export(gains, pathlib.Path(tempfile.mkdtemp()) / "rig", target="yaml")
    >>> made.laws, "parameters.yaml" in made.files
    (('pi', 'rc'), True)
    """
    from eaid.export.export import export as exported
    from eaid.export.options import ExportOptions

    where = {} if output_dir is None else {"folder": Path(output_dir)}
    return exported(gains, fit, chosen(ExportOptions, options, {**keywords, **where}))


def load(path: str | os.PathLike[str]) -> "Fit | Gains | Coupling | Replay | StepSet":
    """A result of any kind from its file, by what the file says of itself.

    Examples
    --------
    >>> import eaid, pathlib, tempfile
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "fit.json"
    >>> fit.save(file)
    >>> eaid.load(file).params.equals(fit.params)
    True
    """
    file = Path(path)
    if not file.is_file():
        raise DataError(f"{file}: no such file; give a fit.json, gains.json, couple.json, replay.h5 or data.h5")
    if h5py.is_hdf5(file):
        from eaid.replay.files import SCHEMA
        from eaid.replay.files import read as read_replay

        with h5py.File(file) as held:
            schema = held.attrs.get("schema", "")
        return read_replay(file)[0] if schema == SCHEMA else read(file)
    kinds: dict[str, type[Any]] = {"fit": Fit, "gains": Gains, "couple": Coupling}
    kind = codec.kind_of(file)
    result: Fit | Gains | Coupling = codec.read(file, kind, kinds[kind])[0]
    return result
