"""The options of `eaid simulate`, by name and help."""

from pathlib import Path
from typing import Annotated

import typer

RIG, MORE, REHAB = "Rig", "More plants", "Rehabilitation"
FitFile = Annotated[Path, typer.Argument(metavar="FIT", help="fit.json of eaid fit.")]
Gains = Annotated[Path | None, typer.Option("--gains", help="gains.json of eaid tune-rc; rc and pi need it.")]
Controllers = Annotated[
    str | None,
    typer.Option(
        "--controller",
        help="Comma-separated: rc, pi, pi-feedforward, open-loop, inverse. Default: rc,pi; sweep adds open-loop.",
    ),
]
Scenario = Annotated[str | None, typer.Option("--scenario", help="steps, multisine (default), sweep, ramp or rehab.")]
Reference = Annotated[
    Path | None, typer.Option("--reference", help="A reference of your own: CSV time_s,reference_nm.")
]
Log = Annotated[
    list[Path] | None,
    typer.Option("--log", help="Recorded runs: their input through the plant; closed-loop ones compared."),
]
Duration = Annotated[float | None, typer.Option("--duration", help="Length of steps, multisine or rehab [s].")]
Rate = Annotated[float | None, typer.Option("--rate-hz", help="Control rate [Hz]; default 1000.", rich_help_panel=RIG)]
NoiseNm = Annotated[
    float, typer.Option("--noise-nm", help="Noise on the measured torque, sd [N·m].", rich_help_panel=RIG)
]
NoiseTime = Annotated[
    float,
    typer.Option("--noise-correlation-s", help="Correlation time of the noise [s]; 0: white.", rich_help_panel=RIG),
]
Noise = Annotated[
    str | None,
    typer.Option(
        "--noise", help="residuals: as large and as coloured as the fit's residuals of one run.", rich_help_panel=RIG
    ),
]
RipplePct = Annotated[
    float, typer.Option("--ripple-pct", help="Rotor ripple, amplitude in % of the torque.", rich_help_panel=RIG)
]
RippleHz = Annotated[
    float | None, typer.Option("--ripple-hz", help="Its frequency [Hz]; default 1/6.", rich_help_panel=RIG)
]
SensorHz = Annotated[
    float,
    typer.Option("--sensor-hz", help="Corner of the torque sensor's low-pass [Hz]; 0: none.", rich_help_panel=RIG),
]
Delay = Annotated[int, typer.Option("--delay-samples", help="Control delay [samples].", rich_help_panel=RIG)]
PwmHz = Annotated[
    float, typer.Option("--pwm-hz", help="Duty latched once a PWM period [Hz]; 0: off.", rich_help_panel=RIG)
]
DutyBits = Annotated[
    int, typer.Option("--duty-bits", help="Resolution of the duty [bit]; 0: unlimited.", rich_help_panel=RIG)
]
Saturation = Annotated[
    bool,
    typer.Option("--saturation/--no-saturation", help="Keep the duty within its limits.", rich_help_panel=RIG),
]
Perturb = Annotated[
    str | None,
    typer.Option(
        "--perturb", help="Factors on the plant, unknown to controllers: Ts=0.9,tau1=1.2.", rich_help_panel=MORE
    ),
]
Plants = Annotated[
    int | None,
    typer.Option("--plants", help="Also on so many plants drawn from the fit's uncertainty.", rich_help_panel=MORE),
]
Threads = Annotated[
    int | None, typer.Option("--threads", help="Threads for --plants; default: all processors.", rich_help_panel=MORE)
]
Best = Annotated[
    bool, typer.Option("--best", help="The least error this plant allows, the future known; how far each is from it.")
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Show all findings.")]
LimbDamping = Annotated[
    float | None,
    typer.Option("--limb-damping", help="Damping of the limb [N·m·s/rad].", rich_help_panel=REHAB),
]
LimbInertia = Annotated[
    float | None, typer.Option("--limb-inertia", help="Its inertia [kg·m²].", rich_help_panel=REHAB)
]
