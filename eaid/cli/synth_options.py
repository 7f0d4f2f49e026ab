"""The options of `eaid synth`, by name and help."""

from pathlib import Path
from typing import Annotated

import typer

WHAT, WHEN, HOW = "What is recorded", "Times", "Disturbances"
Kind = Annotated[
    str | None,
    typer.Option("--kind", help="clutch, friction-force or friction-speed; of a fit.json, its own.",
                 rich_help_panel=WHAT),
]  # fmt: skip
PlantOption = Annotated[str, typer.Option("--plant", help="reference, or a fit.json.", rich_help_panel=WHAT)]
Levels = Annotated[
    str | None,
    typer.Option("--levels", help="Inputs in their unit: 30,40,90 or from:to:step.", rich_help_panel=WHAT),
]
Repeats = Annotated[int | None, typer.Option("--repeats", help="Runs of each level.", rich_help_panel=WHAT)]
DutyFile = Annotated[
    Path | None,
    typer.Option("--duty-file", rich_help_panel=WHAT,
                 help="CSV time_s,duty_pct (force_n, speed_rpm; input in another unit): this input in place of steps."),
]  # fmt: skip
PlanFile = Annotated[
    Path | None,
    typer.Option("--plan", help="The run table of eaid plan: its levels, repeats, times and order.",
                 rich_help_panel=WHAT),
]  # fmt: skip
ExcitationOption = Annotated[
    str | None,
    typer.Option("--excitation", help="staircase, random, prbs, multisine, chirp or closed-loop, in place of steps.",
                 rich_help_panel=WHAT),
]  # fmt: skip
Shape = Annotated[
    str | None,
    typer.Option(
        "--shape",
        rich_help_panel=WHAT,
        help="Of the excitation: duration_s=240,hold_s=0.5:20,duty=10:100,levels=10,rest_s=5,idle_s=2,"
        "frequency_hz=0.05:5,reference_nm=0.6:3.6,gains=21:360.",
    ),
]
GainsFile = Annotated[
    Path | None,
    typer.Option("--gains", help="Closed loop: a gains.json, whose controller drives it.", rich_help_panel=WHAT),
]
Controller = Annotated[str, typer.Option("--controller", help="Of the gains.json: pi or rc.", rich_help_panel=WHAT)]
Idle = Annotated[float | None, typer.Option("--idle", help="Input 0 before the step [s].", rich_help_panel=WHEN)]
Hold = Annotated[float | None, typer.Option("--hold", help="Input at its level [s].", rich_help_panel=WHEN)]
Release = Annotated[float | None, typer.Option("--release", help="Input 0 after the step [s].", rich_help_panel=WHEN)]
Rate = Annotated[float | None, typer.Option("--rate", help="Samples a second [Hz].", rich_help_panel=WHEN)]
Clean = Annotated[
    bool, typer.Option("--clean", help="The plant alone: no noise, scatter, offset or digits.", rich_help_panel=HOW)
]
Noise = Annotated[
    float | None,
    typer.Option("--noise-nm", "--white-nm", help="White noise, sd [N·m].", rich_help_panel=HOW),
]
Coloured = Annotated[
    float | None, typer.Option("--coloured", help="Coloured noise, sd, share of torque.", rich_help_panel=HOW)
]
ColouredS = Annotated[float | None, typer.Option("--coloured-s", help="Its time constant [s].", rich_help_panel=HOW)]
Ripple = Annotated[
    float | None, typer.Option("--ripple", help="Rotor ripple, amplitude, share of torque.", rich_help_panel=HOW)
]
GainScatter = Annotated[
    float | None,
    typer.Option("--gain-scatter", help="Run-to-run sd of the torque's gain, share.", rich_help_panel=HOW),
]
Tau1Scatter = Annotated[
    float | None, typer.Option("--tau1-scatter", help="Run-to-run sd of log tau1.", rich_help_panel=HOW)
]
Tau2Scatter = Annotated[
    float | None, typer.Option("--tau2-scatter", help="Run-to-run sd of log tau2.", rich_help_panel=HOW)
]
Offset = Annotated[
    float | None, typer.Option("--offset-nm", help="Offset of the torque sensor [N·m].", rich_help_panel=HOW)
]
Jitter = Annotated[float | None, typer.Option("--jitter-s", help="Sample instants, sd [s].", rich_help_panel=HOW)]
Resolution = Annotated[
    float | None,
    typer.Option("--resolution-nm", help="Step of the sensor's digits [N·m].", rich_help_panel=HOW),
]
