"""eaid: the workbench for electroadhesive clutches.

steps = eaid.read("bench/")          fit = eaid.fit(steps)          gains = eaid.tune_rc(fit)
run = eaid.simulate(fit, gains)      eaid.report([fit, gains, run], "report/")
"""

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

from eaid.version import __version__

if TYPE_CHECKING:
    from eaid.api import couple, export, fit, load, plan, read, report, simulate, synth, tune_rc
    from eaid.results.fit import FitOptions

FUNCTIONS = (
    "read", "fit", "tune_rc", "simulate", "report", "plan", "plan_excitation", "synth", "load", "export", "couple",
)  # fmt: skip
__all__ = [
    "FitOptions", "__version__",
    "couple", "export", "fit", "load", "plan", "plan_excitation", "read", "report", "simulate", "synth", "tune_rc",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """The public names, whose libraries are loaded when one is first asked for: `eaid --help` needs none."""
    if name in FUNCTIONS:
        from eaid import api

        return getattr(api, name)
    if name == "FitOptions":
        from eaid.results.fit import FitOptions

        return FitOptions
    raise AttributeError(f"module 'eaid' has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)


class _Package(ModuleType):
    """Keeps `eaid.synth`, `eaid.report` and `eaid.export` functions, though packages of these names are imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in FUNCTIONS and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
