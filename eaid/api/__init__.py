"""The public functions: logs → steps → fit → gains → replay → page, each a plain call that prints nothing.

Examples
--------
>>> import eaid
>>> logs = eaid.synth(levels=(20.0, 40.0, 60.0, 80.0, 100.0), repeats=2, rate_hz=100.0, seed=1)
>>> fit = eaid.fit(logs)
>>> fit.converged
True
"""

from eaid.api.files import export, load, report
from eaid.api.fitting import fit, plan, plan_excitation
from eaid.api.logs import read, synth
from eaid.api.loops import couple, simulate, tune_rc

__all__ = [
    "couple", "export", "fit", "load", "plan", "plan_excitation", "read", "report", "simulate", "synth", "tune_rc",
]  # fmt: skip
