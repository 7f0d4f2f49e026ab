"""Results of any kind: from their files, on a page, on Axes."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eaid.api.given import File, Result, held
from eaid.declared import chosen, taking
from eaid.errors import UsageError
from eaid.options import ReportOptions
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay

if TYPE_CHECKING:
    from eaid.sessions.compare import Comparison
    from eaid.sessions.rig import Rig


def load(path: File) -> "Result | Rig | Comparison":
    """A result of any kind from its file, by what the file says of itself.

    Parameters
    ----------
    path
        A fit.json, gains.json, couple.json, rig.json, compare.json, replay.h5 or data.h5.

    Returns
    -------
    Fit or Gains or Coupling or Rig or Comparison or Replay or StepSet
        The result, with units as the file has them.

    Raises
    ------
    DataError
        No such file, a file that is no result of eaid, or one that was changed after it was written.

    Examples
    --------
    >>> import eaid, pathlib, tempfile
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "fit.json"
    >>> fit.save(file)
    >>> eaid.load(file).params.equals(fit.params)
    True
    """
    if not isinstance(path, str | os.PathLike):
        raise UsageError(f"path: is a {type(path).__name__}; give the file of a result")
    result: Result | Rig | Comparison = held(path)
    return result


@taking(ReportOptions)
def report(
    *results: "Result | File | Sequence[Result | File]",
    to: "File | None" = None,
    options: ReportOptions | None = None,
    force: bool = False,
    **keywords: Any,
) -> Path:
    """Write one self-contained page, and the figures, of any results.

    Parameters
    ----------
    results
        Fits, gains, replays, steps, walls, or their files: one or several, also as a list.
    to
        Folder that is made where it is not there, its parent has to be; without it the last of `results` is that.
    options
        Which figures, and their formats.
    force
        Write over a report.
    **keywords
        Fields of `ReportOptions`, each as above.

    Returns
    -------
    Path
        The page, `to`/report.html; figures lie in `to`/figures.

    Raises
    ------
    UsageError
        The folder holds a report and `force` is not given, or an option names what is not there.

    Examples
    --------
    >>> import eaid, pathlib, tempfile
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> page = eaid.report(fit, to=pathlib.Path(tempfile.mkdtemp()) / "report")
    >>> page.name
    'report.html'
    """
    from eaid.report.results import gathered
    from eaid.report.write import write_report

    how = chosen(ReportOptions, options, keywords)
    each: list[Any] = [one for some in results for one in (some if isinstance(some, list | tuple) else [some])]
    folder = each.pop() if to is None and each else to
    if not isinstance(folder, str | os.PathLike):
        raise UsageError("«to»: name the folder of the page, as report(fit, gains, to='report')")
    return write_report(gathered(list(map(held, each))), Path(folder), how, force)[0]


def plot(result: "Fit | Gains | Replay | Rig | Comparison", ax: Any = None) -> Any:
    """A result on matplotlib Axes: the step responses of a fit, margins of gains over the input, traces of a replay,
    the control chart of a rig, T_s of sessions that are compared.

    Parameters
    ----------
    result
        A fit, gains, a replay, a rig or a comparison.
    ax
        Axes that are drawn on; without them new ones. Or `"residuals"`, of a fit: what it leaves over time, with itself
        a lag later, and against the input, on three new Axes.

    Returns
    -------
    matplotlib.axes.Axes or array of them
        The Axes, labelled with units.

    Raises
    ------
    UsageError
        Something else in place of a result or of Axes.

    Examples
    --------
    >>> import eaid
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> eaid.plot(fit).get_xlabel()
    'Time since the step (s)'
    """
    from eaid.report.paper import plot as drawn
    from eaid.report.paper import plot_residuals
    from eaid.sessions.compare import Comparison
    from eaid.sessions.rig import Rig

    if not isinstance(result, Fit | Gains | Replay | Rig | Comparison):
        raise UsageError(f"result: is a {type(result).__name__}; give a fit, gains or a replay")
    if isinstance(result, Fit) and isinstance(ax, str) and ax == "residuals":
        return plot_residuals(result)
    if ax is not None and not hasattr(ax, "plot"):
        raise UsageError(f"«ax» {ax!r:.40}: is no matplotlib Axes; leave it out, or give one of plt.subplots()")
    return drawn(result, ax)
