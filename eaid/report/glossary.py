"""The words that the page uses and explains."""

GLOSSARY: tuple[tuple[str, str], ...] = (
    ("duty u", "share of the PWM period during which voltage is on, in percent; the clutch's input"),
    ("PWM", "pulse-width modulation: voltage switched on and off many times a second"),
    ("level", "one value of the input that was stepped to: a duty, a force or a speed"),
    ("T_s", "steady torque: what a step reaches after a long time"),
    ("τ1, τ2", "fast and slow time constant: after τ, 63 % of that part's rise is done"),
    ("C", "share of the torque that rises with the fast constant, 0.85 unless said otherwise"),
    ("C_f", "coefficient of friction: friction stress over normal stress"),
    ("B, B_m, B_M", "duty per rate of torque, 1/b0 of the linear model; its least and largest value over the levels"),
    ("fit", "the choice of a model's values that makes the sum of squared differences from the data least"),
    ("residual", "measured value minus the model's"),
    ("RMSE", "root mean square error: a typical size of the residuals, in the unit of the data"),
    ("sd", "standard deviation: how far repeats scatter around their mean"),
    ("95 % interval", "range that holds the true value in 95 of 100 such experiments, if the model is right"),
    ("autocorrelation", "how much a residual resembles itself a little later: 1 the same, 0 not at all"),
    ("joint, two-stage", "all levels fitted at once; or each level first and a curve through their values after"),
    ("solver", "the search for the least sum of squares (SLSQP); its result is checked by a test of our own"),
    ("RC, PI", "the paper's robust controller; a controller that uses the error and its integral"),
    (
        "ρ, α, φ, Q_M, ε, γ",
        "terms of the robust controller's condition for stability, inequality (15), and of its switch",
    ),
    ("boundary layer", "errors so small that the robust term is linear; beyond it the term has its full size"),
    ("Lyapunov argument", "the proof of stability behind inequality (15); it needs all of its bounds to be true"),
    (
        "zero-offset, pooled-offset, pooled-dynamics",
        "how b0 of a single level is told from c0: c0 is 0; c0 of all levels; a0 and c0 of all levels",
    ),
    ("‖ξ‖", "size of the torque error and its integral taken together"),
    ("open loop", "the duty follows from the model alone, without looking at the torque"),
    ("replay", "a computed experiment: a controller on the fitted model of the clutch"),
    ("overshoot, settling time", "how far a step goes beyond its goal; how long until it stays within 2 % of it"),
    (
        "χ², AICc",
        "measures of closeness: the first counts squared misses in units of their scatter, the second adds a "
        "price for each value fitted",
    ),
    ("margin", "how much gain, phase lag or delay a control loop bears before it becomes unstable"),
    ("p", "probability of so large a difference by chance alone"),
    ("dB", "decibel: 20 times the decimal logarithm of a ratio; 0 is equal, −6 is half"),
    ("synthetic", "computed from a known model with noise added; used where no recording was published"),
)
"""Word → meaning, for a reader who knows clutches but not our names."""
