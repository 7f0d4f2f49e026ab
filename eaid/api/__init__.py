"""The public functions: logs → steps → fit → gains → replay → page, each a call with typed options and results.

The commands call the same functions. A function takes its options whole (`eaid.FitOptions(...)`) or one by one as
keywords; `eaid.options` declares them, and signatures and docstrings say them here. Where a result is taken its file is
taken too.
"""

from eaid.api.loops import couple, export, simulate, tune_rc
from eaid.api.models import fit, plan, read, synth
from eaid.api.pages import load, plot, report
from eaid.api.rigs import compare, sessions, today

__all__ = [
    "compare", "couple", "export", "fit", "load", "plan", "plot", "read", "report", "sessions", "simulate", "synth",
    "today", "tune_rc",
]  # fmt: skip
