"""What rig a result is of: its units and names, and whether it is the clutch that the paper describes."""

from eaid.apparatus import PAPER
from eaid.control.kinds import LAW_KINDS
from eaid.plant.dynamics import SHARE
from eaid.results.models import FittedData
from eaid.steps.stepset import StepSet

CONTROLLER_NAMES = {name: row.title for name, row in LAW_KINDS.items()} | {
    "open-loop": "open loop", "inverse": "model inverse",
}  # fmt: skip

# Scenario → how it is called, in the order of the paper and of the page
SCENARIO_NAMES = {
    "steps": "steps", "multisine": "sum of sines", "sweep": "sines of rising frequency",
    "reference": "own reference", "log": "recorded input", "rehab": "rehabilitation",
}  # fmt: skip


def controller_name(name: str) -> str:
    """A controller's name as a reader knows it."""
    return CONTROLLER_NAMES.get(name, name)


def of_the_paper(data: FittedData | StepSet | None) -> bool:
    """Whether published values belong beside these: those of the same units."""
    return data is not None and (data.input_unit, data.output_unit) == PAPER[data.kind]


def level_text(level: float, unit: str) -> str:
    """A level as written beside its curve: 40 %, 86 N; the bare number where levels have no unit."""
    return (f"{level:.3g} {unit}" if level < 1000 else f"{level:.0f} {unit}").rstrip()


def gain_unit(input_unit: str, output_unit: str) -> str:
    """Unit of B = 1/b0."""
    return f"{input_unit}·s/({output_unit})"


# Parameter → formula as printed (σ in kPa), coefficients, RMSE of the trend
TABLE_I = {
    "Ts": ("0.0944 σ − 0.0896", (0.0944, -0.0896), 0.323),
    "C_f": ("0.29 e^(−0.000725 σ) − 0.42 e^(−0.337 σ)", (0.29, -0.000725, -0.42, -0.337), 0.0127),
    "tau1": ("6.01 e^(−0.431 σ) + 0.11 e^(0.0492 σ)", (6.01, -0.431, 0.11, 0.0492), 0.277),
    "tau2": ("40.25 e^(−0.219 σ) + 1.37 e^(0.0476 σ)", (40.25, -0.219, 1.37, 0.0476), 2.67),
}

# Parameter → formula as printed (Ω in RPM), coefficients, RMSE of the trend
TABLE_II = {
    "Ts": ("0.349 e^(−0.230 Ω) + 1.042 e^(0.00608 Ω)", (0.349, -0.230, 1.042, 0.00608), 0.0523),
    "tau1": ("0.425 e^(−0.310 Ω) + 0.0498 e^(−0.0150 Ω)", (0.425, -0.310, 0.0498, -0.0150), 0.0020),
    "tau2": ("5.375e5 e^(−0.0507 Ω) − 5.374e5 e^(−0.0507 Ω)", (5.375e5, -0.0507, -5.374e5, -0.0507), 0.850),
}

# Polynomials of the duty [%], lowest power first
TABLE_III = {
    "tau1": (6.74e-3, 2.39e-2, -2.13e-4),
    "tau2": (0.93, 0.41, -2.64e-3),
    "Ts": (-1.19e-2, 1.81e-3, -2.97e-5, 1.85e-7),
    "C": (SHARE,),
}

TABLE_IV = {"B_m": 12.4, "B_M": 42.6, "Q_M": 5.0, "phi": 0.05, "epsilon": 0.5, "gamma": 50.0, "K_D": 3.0, "K_P": 4.5}
