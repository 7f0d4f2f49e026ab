"""The options of `eaid tune-rc`, by name and help."""

from pathlib import Path
from typing import Annotated

import typer

ROBUST, PI_PANEL, SEARCH, RIG = "Robust controller", "PI controller", "Search", "Rig"
FitFile = Annotated[Path, typer.Argument(metavar="FIT", help="fit.json of eaid fit; only its linear part is needed.")]
Bounds = Annotated[
    str | None,
    typer.Option(
        "--bounds", help="b0 of one level: zero-offset, pooled-offset, pooled-dynamics; default: the fit's.",
        rich_help_panel=ROBUST,
    ),
]  # fmt: skip
Levels = Annotated[
    str | None,
    typer.Option("--levels", help="Levels that B_m, B_M are taken over: 30:100 or 30,40.", rich_help_panel=ROBUST),
]
Widen = Annotated[
    bool,
    typer.Option("--widen-bounds", help="Take the far ends of the 95 % intervals of B.", rich_help_panel=ROBUST),
]
BHat = Annotated[str, typer.Option("--b-hat", help="B̂: pooled (1/b0), minimax, or a value.", rich_help_panel=ROBUST)]
Kp = Annotated[float | None, typer.Option("--kp", help="K_P [1/s²]; default 4.5.", rich_help_panel=ROBUST)]
Kd = Annotated[float | None, typer.Option("--kd", help="K_D [1/s]; default 3.", rich_help_panel=ROBUST)]
Frequency = Annotated[
    float | None,
    typer.Option(
        "--natural-frequency", help="In place of --kp, --kd: ω_n [rad/s], with --damping.", rich_help_panel=ROBUST
    ),
]
Damping = Annotated[
    float | None, typer.Option("--damping", help="In place of --kp, --kd: damping ratio.", rich_help_panel=ROBUST)
]
QMax = Annotated[
    float | None,
    typer.Option("--q-max", help="Q_M, largest slope of the reference; default 5 N·m/s.", rich_help_panel=ROBUST),
]
Reference = Annotated[
    str | None,
    typer.Option(
        "--reference", rich_help_panel=ROBUST,
        help="CSV time_s,reference_nm, or multisine, steps or sweep: Q_M is taken from it, or judged by it.",
    ),
]  # fmt: skip
Phi = Annotated[
    str | None,
    typer.Option(
        "--phi", rich_help_panel=ROBUST,
        help="φ in the reading's own number (default 0.05), or data: what model and logs show.",
    ),
]  # fmt: skip
Data = Annotated[
    list[Path] | None,
    typer.Option("--data", help="Logs or data.h5 for --phi data and --optimize; default: those the fit names."),
]
Epsilon = Annotated[
    float | None,
    typer.Option("--epsilon", help="ε, half width of the boundary layer; default 0.5.", rich_help_panel=ROBUST),
]
Gamma = Annotated[
    float | None,
    typer.Option("--gamma", help="γ, sharpness of the soft switch; default 50.", rich_help_panel=ROBUST),
]
PScale = Annotated[
    float, typer.Option("--p-scale", help="p of P = p·I in the Lyapunov equation.", rich_help_panel=ROBUST)
]
Rho = Annotated[
    str,
    typer.Option("--rho", help="Reading of Eq. (15): paper (B_M φ) or textbook (φ/B_m).", rich_help_panel=ROBUST),
]
Alpha = Annotated[
    str,
    typer.Option("--alpha", help="α that ρ is made with: formula, or reached.", rich_help_panel=ROBUST),
]
Overshoot = Annotated[
    float | None,
    typer.Option("--pi-overshoot", help="Overshoot on the linear model [%].", rich_help_panel=PI_PANEL),
]
Settling = Annotated[
    float | None, typer.Option("--pi-settling", help="Settling time, 2 % band [s].", rich_help_panel=PI_PANEL)
]
PIGains = Annotated[str | None, typer.Option("--pi-gains", help="K_P,K_I; default 21,360.", rich_help_panel=PI_PANEL)]
AntiWindup = Annotated[
    str, typer.Option("--anti-windup", help="conditional (integration) or back-calculation.", rich_help_panel=RIG)
]
Limits = Annotated[
    str | None,
    typer.Option(
        "--duty-limits", rich_help_panel=RIG,
        help="Lowest and highest input of the actuator; default 0,100 %, else what was identified.",
    ),
]  # fmt: skip
RateHz = Annotated[
    float | None,
    typer.Option("--rate-hz", help="Control rate [Hz]; default: the fit's, else 1000.", rich_help_panel=RIG),
]
PwmHz = Annotated[
    float | None,
    typer.Option(
        "--pwm-hz", help="Duty latched at this rate [Hz]; default: the fit's, else 300; 0: off.", rich_help_panel=RIG
    ),
]
Optimize = Annotated[
    bool,
    typer.Option("--optimize", help="Choose P's scale, ε and φ for the least RMS error.", rich_help_panel=SEARCH),
]
OptimizeFor = Annotated[
    str,
    typer.Option(
        "--optimize-for",
        help="tracking: least RMS error; stiffness: stiffest passive wall. Implies --optimize.",
        rich_help_panel=SEARCH,
    ),
]
Also = Annotated[
    str | None,
    typer.Option(
        "--optimize-also", help="Chosen too: frequency (ω_n), b-hat. Implies --optimize.", rich_help_panel=SEARCH
    ),
]
Plants = Annotated[
    int | None,
    typer.Option("--plants", help="Plants drawn from the fit's uncertainty; default 16.", rich_help_panel=SEARCH),
]
NoiseNm = Annotated[
    float | None,
    typer.Option("--noise-nm", help="Torque noise, sd [N·m]; default: what the logs show.", rich_help_panel=SEARCH),
]
ChatterLimit = Annotated[
    float | None,
    typer.Option(
        "--chatter-limit", help="Most mean |Δu| per sample; default: that of the start.", rich_help_panel=SEARCH
    ),
]
Evaluations = Annotated[
    int | None,
    typer.Option("--evaluations", help="Candidates after the first scatter; default 160.", rich_help_panel=SEARCH),
]
Unidentified = Annotated[
    bool, typer.Option("--allow-unidentified", help="Use a fit that is marked not identifiable; the result is marked.")
]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Show every margin, the readings of ρ, and all findings.")
]
