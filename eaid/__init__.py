"""eaid: the workbench for electroadhesive clutches.

steps = eaid.read("bench/")          fit = eaid.fit(steps)          gains = eaid.tune_rc(fit)
run = eaid.simulate(fit, gains)      eaid.report(fit, gains, run, to="report/")

`__init__.pyi` says the signatures to editors; `python docs/stub.py` writes it.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

from eaid.version import __version__

__all__ = [
    "CompareOptions", "CoupleOptions", "Coupling", "DataError", "EaidError", "ExportOptions", "Fit", "FitOptions",
    "Gains", "GainsError", "Plan", "PlanOptions", "ReadOptions", "Replay", "ReportOptions", "SessionsOptions",
    "SimulateOptions", "StepSet", "SynthOptions", "TuneOptions", "UsageError", "__version__",
    "compare", "couple", "export", "fit", "load", "plan", "plot", "read", "report", "sessions", "simulate", "synth",
    "today", "tune_rc",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """The public names, whose libraries are loaded when one is first asked for: `eaid --help` needs none."""
    if name in __all__:
        for place in ("errors", "options", "api", "api.given", "api.models"):  # the quick ones first
            if (found := getattr(import_module(f"eaid.{place}"), name, None)) is not None:
                return found
    raise AttributeError(f"module 'eaid' has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)


class _Package(ModuleType):
    """Keeps `eaid.synth`, `eaid.report` and `eaid.export` functions, though packages of these names are imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in __all__ and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
