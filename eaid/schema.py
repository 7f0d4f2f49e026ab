"""The shapes of fit.json, gains.json and of what replay.h5 says of itself: what every command may rely on.

docs/files.md explains the keys; here stands what each may hold. A fit.json of a user's own script needs few of them.
"""

from collections.abc import Mapping
from typing import Any

from eaid.shapes import Flag, Many, Number, Part, Shape, Word

NUMBER, KNOWN, TEXT, FLAG = Number(), Number(known=True), Word(), Flag()
POSITIVE = Number(least=0.0, above=True)
COUNT = Number(least=0, most=1e15, whole=True)
TEXTS = Many(TEXT)
NUMBERS = Many(KNOWN)
INTERVAL = Many(NUMBER, 2)
KINDS = ("clutch", "friction-force", "friction-speed")


def _polynomials(tau1: Shape, tau2: Shape, steady: Shape) -> dict[str, Shape]:
    return {"tau1": tau1, "tau2": tau2, "Ts": steady}


def _alike(names: str, shape: Shape) -> dict[str, Shape]:
    return dict.fromkeys(names.split(), shape)


SOLVER = Part(
    {
        "method": TEXT, "converged": FLAG, "message": TEXT, "promise": NUMBER, "evaluations": NUMBER,
        "starts": Many(Part({"cost": NUMBER})), "at_bounds": TEXTS,
    }
)  # fmt: skip
ERRORS: dict[str, Shape] = {"rmse": NUMBER, "sse": NUMBER, "abs_error": Part({"mean": NUMBER, "sd": NUMBER})}
PER_LEVEL = Many(Part({"level": NUMBER, **ERRORS}, needs=("level",)))
HOLD_OUT = Part({"levels": PER_LEVEL, "fitted_rmse": NUMBER, "rmse": NUMBER})
VERDICT: dict[str, Shape] = {
    "solver": SOLVER, "warnings": TEXTS, "identifiable": FLAG, "not_identifiable_because": TEXTS, "open": TEXTS,
    "hold_out": HOLD_OUT,
}  # fmt: skip
COEFFICIENTS = {"linear": 2, "merged-exponential": 3, "double-exponential": 4}
"""How many a trend of each form has."""


def _trend_doubt(trend: Mapping[str, Any]) -> str | None:
    wanted = COEFFICIENTS[trend["form"]]
    held = len(trend["coefficients"])
    return None if held in (0, wanted) else f"has {held} coefficients, and a {trend['form']} one has {wanted}"


TREND = Part(
    {
        "over": TEXT, "form": Word(tuple(COEFFICIENTS)), "coefficients": NUMBERS, "rmse": NUMBER, "converged": FLAG,
        "at_bounds": TEXTS, "ci95": Many(INTERVAL), "words": TEXTS,
    },
    needs=("form", "coefficients"),
    doubt=_trend_doubt,
)  # fmt: skip
FRICTION = Part(
    {
        "C": NUMBER,
        "levels": Many(
            Part(
                {
                    **_alike("level level_pct stress_kpa speed_rpm Ts C_f", NUMBER), "tau1": POSITIVE, "tau2": POSITIVE,
                    "C": NUMBER, **ERRORS, "samples": COUNT, "solver": SOLVER, "ci95": Part(rest=INTERVAL),
                },
                needs=("level",),
            )
        ),
        "trends": Part(rest=TREND),
        **VERDICT,
    }
)  # fmt: skip
CURVES = Many(
    Part({**_alike("level Ts tau1 tau2 torque_half_width_nm", NUMBER), "ci95": Part(rest=INTERVAL)}, needs=("level",))
)
ESTIMATE: dict[str, Shape] = {
    **ERRORS, "per_level": PER_LEVEL, "curves": CURVES,
    "ci95": Part({**_polynomials(Many(INTERVAL), Many(INTERVAL), Many(INTERVAL)), "C": INTERVAL}),
    "covariance": Part({"parametrisation": TEXT, "order": TEXTS, "matrix": Many(NUMBERS)}),
    "misfit": Part(rest=NUMBER),
}  # fmt: skip
OTHER_ESTIMATE = Part(
    {
        **_polynomials(Many(KNOWN, 3), Many(KNOWN, 3), Many(KNOWN, 4)), "C": Number(least=0.0, most=1.0),
        "u_range": Many(KNOWN, 2), **ESTIMATE, "solver": SOLVER,
    },
    needs=("tau1", "tau2", "Ts"),
)  # fmt: skip
NONLINEAR = Part(
    {
        **_polynomials(Many(KNOWN, 3, known=True), Many(KNOWN, 3, known=True), Many(KNOWN, 4, known=True)),
        "C": Number(known=True, least=0.0, most=1.0), "u_range": Many(Number(known=True, least=0.0), 2, known=True),
        **ESTIMATE, **VERDICT, "two_stage": OTHER_ESTIMATE, "joint": OTHER_ESTIMATE, "estimator": TEXT,
    },
    needs=("tau1", "tau2", "Ts", "u_range"),
)  # fmt: skip
BOUNDS = Part(
    {**_alike("convention means", TEXT), "levels": NUMBERS, "B_m": NUMBER, "B_M": NUMBER, "ci95": Part(rest=INTERVAL)}
)
LINEAR = Part(
    {
        **_alike("a0 b0 c0", KNOWN), **ERRORS, **VERDICT, "ci95": Part(rest=INTERVAL),
        "per_level": Many(
            Part(
                {**_alike("level a0 gain b0 c0 B rmse sse", NUMBER), "ci95": Part(rest=INTERVAL)},
                needs=("level", "a0", "gain"),
            )
        ),
        "bounds": BOUNDS, "conventions": Part(rest=BOUNDS),
    },
    needs=("a0", "b0", "c0"),
)  # fmt: skip
RELEASE = Part(
    {
        "C": NUMBER, "tau1": POSITIVE, "tau2": POSITIVE, **ERRORS, "solver": SOLVER, "warnings": TEXTS,
        "levels": Many(Part(_alike("level share tau1 tau2 rising_tau1 rising_tau2 amplitude residual rmse", NUMBER))),
    }
)  # fmt: skip


def _rig_doubt(rig: Mapping[str, Any]) -> str | None:
    inner, outer = rig.get("inner_radius_m") or 0.04, rig.get("outer_radius_m") or 0.06
    return None if inner < outer else f"has an inner radius of {inner:g} m and an outer one of {outer:g} m"


DATA = Part(
    {
        "kind": Word(KINDS), "input_unit": TEXT, "output_unit": TEXT, "synthetic": TEXT, "warnings": TEXTS,
        "levels": NUMBERS, **_alike("repeats samples record_s", Many(NUMBER)), "sample_rate_hz": POSITIVE,
        "apparatus": Part(rest=POSITIVE, keys={"surfaces": Number(least=1, most=1e6, whole=True)}, doubt=_rig_doubt),
        "sources": Many(
            Part({**_alike("path sha256 run edge", TEXT), **_alike("level baseline_nm step_s", NUMBER),
                  **_alike("repeat samples", COUNT), "warnings": TEXTS})
        ),
        "inputs": Many(Part({"path": TEXT, "sha256": TEXT}, needs=("path",))),
    }
)  # fmt: skip
UNCERTAINTY = Part(
    {
        "noise": Part(
            {"sensor_nm2_s": Number(least=0.0), "ripple_s": Number(least=0.0),
             "scatter": Part(_polynomials(Number(least=0.0), Number(least=0.0), Number(least=0.0)))}
        ),
        "adequacy": Part(
            {
                "shapes": Many(Part({"name": TEXT, **_alike("parameters rmse aicc bic", NUMBER)})),
                "orders": Many(
                    Part({"parameter": TEXT, **_alike("order chi_square aicc leave_one_out_pct", NUMBER)})
                ),
                "lack_of_fit": Many(
                    Part({**_alike("level ratio chance systematic_nm", NUMBER), "beyond": FLAG}, needs=("level",))
                ),
                "residual_autocorrelation": Number(least=-1.0, most=1.0), "effective_samples": POSITIVE,
                "warnings": TEXTS,
            }
        ),
    }
)  # fmt: skip
TRACKING: dict[str, Shape] = _alike(
    "max_abs_error_nm rms_error_nm mean_abs_error_nm iae_nm_s mean_abs_duty_step_pct saturated_fraction", NUMBER
)
WOUND = Part({"method": TEXT, "gain": NUMBER})
MARGIN = Part({"stable": FLAG, **_alike("gain_db delay_s phase_deg crossover_hz", NUMBER)})
PAIR = Part({"constant": NUMBER, "slope": NUMBER})
RC = Part(
    {
        **_alike("K_P K_D", KNOWN), **_alike("B_hat B_m B_M alpha alpha_reached Q_M phi epsilon gamma", NUMBER),
        **_alike("phi_needed_pct phi_honest_pct natural_frequency_rad_s damping reference_slope_nm_s", NUMBER),
        **_alike("guaranteed phi_holds Q_M_holds", FLAG), **_alike("P Q", Many(Many(KNOWN, 2), 2)),
        "rho": Part({"convention": TEXT, "constant": NUMBER, "slope": NUMBER, "needed": PAIR}), "anti_windup": WOUND,
        "ultimate_bound": Part({"torque_error_nm": NUMBER, "replayed_nm": NUMBER}),
    }
)  # fmt: skip

RESULTS: dict[str, Part] = {
    "fit": Part(
        {
            "data": DATA, "friction": FRICTION, "nonlinear": NONLINEAR, "linear": LINEAR, "release": RELEASE,
            "uncertainty": UNCERTAINTY, "warnings": TEXTS,
        }
    ),
    "gains": Part(
        {
            "model": Part(_alike("a0 b0 c0", KNOWN)), "rc": RC,
            "pi": Part(
                {**_alike("K_P K_I", KNOWN), **_alike("overshoot_pct settling_s", NUMBER), "anti_windup": WOUND}
            ),
            "duty_limits_pct": Many(KNOWN, 2), "warnings": TEXTS,
            "margins": Part(
                {"points": Many(Part({**_alike("duty_pct torque_nm", NUMBER), **_alike("rc pi", MARGIN)}))}
            ),
            "replayed": Part({"rc": Part(TRACKING), "pi": Part(TRACKING)}),
        }
    ),
}  # fmt: skip
"""Kind of a JSON result → what it may hold. A file of that kind has one of these parts at least."""

SAMPLE = Part(_alike("n independent mean sd q1 median q3 whisker_low whisker_high outliers", NUMBER))
METRICS = Part(
    {
        **TRACKING, "counted_from_s": NUMBER, "reference_is": TEXT, "guarantee_holds_fraction": NUMBER,
        **_alike("rms_difference_nm max_abs_difference_nm mean_difference_nm R2 fit_pct one_step_pct", NUMBER),
        "steps": Many(Part(_alike("from_nm to_nm rise_time_s overshoot_pct settling_s settling_5pct_s", NUMBER))),
        "frequencies": Many(
            Part(
                {"frequency_hz": POSITIVE, **_alike("gain_db phase_deg mean_abs_error_nm", NUMBER)},
                needs=("frequency_hz", "mean_abs_error_nm"),
            )
        ),
        "plants": Part(
            {"metrics": Part(rest=Part({**_alike("p2.5 median p97.5", NUMBER), "worst": Part({"value": NUMBER})}))}
        ),
        "modes": Part(rest=Part({"abs_position_error_deg": SAMPLE, "mean_abs_torque_error_nm": NUMBER})),
        "tests": Many(
            Part({"modes": TEXTS, "samples": Part({"p": NUMBER}),
                  "cycles": Part(_alike("p_welch p_rank least_p_rank", NUMBER))})
        ),
        "normality": Part(rest=Part({"p": NUMBER, "rejected": FLAG})),
    }
)  # fmt: skip
"""What a controller's attribute `metrics` in replay.h5 may hold."""
REPLAY = Part(
    {
        "scenario": TEXT, "synthetic": TEXT, "warnings": TEXTS, "plants": COUNT, "band_quantiles": NUMBERS,
        **_alike("counted_from_s uncounted_s", NUMBER), "dt_s": POSITIVE, "inputs": Part(), "rig": Part(),
    }
)  # fmt: skip
"""What the root attributes of replay.h5 may hold."""
