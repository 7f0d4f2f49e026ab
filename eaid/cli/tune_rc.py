"""`eaid tune-rc`: a fit → gains of both controllers, and what may be expected of them."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, Seeded, Verbose, argument, option, taken, takes, written
from eaid.cli.words import as_typed, pair
from eaid.errors import UsageError

ROBUST, PI, RIG, SEARCH, ADVANCED = "Robust controller", "PI controller", "Rig", "Search", "Advanced"
B_HAT, ANTI_WINDUP = ("pooled", "minimax"), ("conditional", "back-calculation")
SCENARIOS = ("multisine", "steps", "sweep", "ramp")
Pair = tuple[float, float] | None


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, Seeded, Verbose):
    """What `eaid tune-rc` is told."""

    fit: Path = argument("FIT", "fit.json of eaid fit; only its linear part is needed.")
    kp: float | None = option(None, "K_P [1/s²]; by itself 4.5.", ROBUST)
    kd: float | None = option(None, "K_D [1/s]; by itself 3.", ROBUST)
    natural_frequency: float | None = option(None, "ω_n [rad/s], in place of K_P and K_D.", ROBUST)
    damping: float | None = option(None, "Damping ratio, with the natural frequency.", ROBUST)
    b_hat: str | float = option("pooled", "1/b0, the middle of B_m, B_M, or a value.", ROBUST, words=B_HAT, number=True)
    q_max: float | None = option(None, "Q_M, largest slope of the reference; by itself 5 N·m/s.", ROBUST)
    phi: str | float | None = option(
        None, "By itself 0.05; data: by model and logs.", ROBUST, words="data", number=True
    )
    reference: str | None = option(
        None, "Q_M is taken from it, or judged by it.", ROBUST, words=SCENARIOS, read=as_typed, shown="FILE|WORD"
    )
    data: list[Path] | None = option(None, "Logs for --phi data and --optimize; by itself the fit's own.", ROBUST)
    pi_gains: Pair = option(None, "Its gains; by itself 21,360.", PI, read=pair("21,360"), shown="K_P,K_I")
    pi_overshoot: float | None = option(None, "Or designed: overshoot on the linear model [%].", PI)
    pi_settling: float | None = option(None, "And settling time, 2 % band [s].", PI)
    duty_limits: Pair = option(None, "By itself 0,100 % or as identified.", RIG, read=pair("0,100"), shown="LOW,HIGH")
    rate_hz: float | None = option(None, "Control rate [Hz]; by itself the fit's, else 1000.", RIG)
    pwm_hz: float | None = option(None, "Duty latched at [Hz]; 0: off; by itself the fit's, else 300.", RIG)
    optimize: bool = option(False, "Choose P's scale, ε and φ for the least RMS error.", SEARCH)
    optimize_for: str = option(
        "tracking", "Or the stiffest wall; implies --optimize.", SEARCH, words="tracking|stiffness"
    )
    optimize_also: tuple[str, ...] = option((), "ω_n, B̂ too.", SEARCH, words="frequency|b-hat", several=True)
    plants: int | None = option(None, "Plants drawn from the fit's uncertainty; by itself 16.", SEARCH)
    noise_nm: float | None = option(None, "Torque noise, sd [N·m]; by itself what the logs show.", SEARCH)
    chatter_limit: float | None = option(None, "Most mean |Δu| per sample; by itself that of the start.", SEARCH)
    evaluations: int | None = option(None, "Candidates after the first scatter; by itself 160.", SEARCH)
    bounds_levels: str | None = option(None, "Levels that B_m, B_M are taken over: 30:100.", ADVANCED, levels=True)
    widen_bounds: bool = option(False, "Take the far ends of the 95 % intervals of B.", ADVANCED)
    epsilon: float | None = option(None, "ε, half width of the boundary layer; by itself 0.5.", ADVANCED)
    gamma: float | None = option(None, "γ, sharpness of the soft switch; by itself 50.", ADVANCED)
    p_scale: float = option(5.0, "p of P = p·I in the Lyapunov equation.", ADVANCED)
    rho: str = option("paper", "Eq. (15) read as B_M φ, or as φ/B_m.", ADVANCED, words="paper|textbook")
    alpha: str = option("formula", "α that ρ is made with.", ADVANCED, words="formula|reached")
    anti_windup: str = option("conditional", "How the integral is held at a limit.", ADVANCED, words=ANTI_WINDUP)
    allow_unidentified: bool = option(False, "Use a fit that is marked not identifiable; marked.", ADVANCED)
    output: Path = written("gains.json")


@takes(Arguments)
def command(args: Arguments) -> None:
    """Gains of the robust controller and of a PI from a fit, with one verdict on the guarantee.

    Exit code 5: the fit or the wishes are not physical, out of reach, or unstable on the linear model.

    Example: eaid tune-rc fit.json --b-hat minimax --phi data -o gains.json
    """
    from eaid import api
    from eaid.cli import inputs
    from eaid.files import refuse_to_overwrite
    from eaid.logs.manifest import files_read
    from eaid.report.tables import gains as tables
    from eaid.results import codec
    from eaid.results.fit import Fit
    from eaid.results.gains import GainsInputs
    from eaid.results.tuning import TuneOptions

    file = Path(args.reference) if args.reference and args.reference not in SCENARIOS else None
    read = [args.fit, *([file] if file else []), *files_read(args.data or [])]
    refuse_to_overwrite(args.output, args.force, read)
    options = taken(TuneOptions, args)
    if args.data and options.phi != "data" and not options.searches:
        raise UsageError("--data: does nothing without --phi data or --optimize; leave it out")
    fitted, doubts = codec.read(args.fit, "fit", Fit)
    logs = inputs.logs_of(fitted, args.fit, args.data, options)
    gains = api.tune_rc(fitted, options, reference=args.reference, logs=logs, progress=console.progress)
    gains = inputs.stamped(gains, args, GainsInputs, fit=args.fit, reference=file)
    codec.write(args.output, gains, "gains", args.force)
    if args.json:
        console.print_json(gains, "gains")
    else:
        console.line(f"guarantee: {tables.guarantee_words(gains)}")
        for table in [*tables.tables_of(gains, asked=False), *(tables.further_tables(gains) if args.verbose else ())]:
            console.show(table)
    console.tell([*gains.findings, *doubts], args.verbose)
    console.done(args.output, "gains of rc and pi", f"eaid simulate {args.fit} --gains {args.output}")
