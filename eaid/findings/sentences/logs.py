"""Sentences about logs and the steps cut from them: what reading had to do, and what is wrong or doubtful."""

from eaid.findings.row import Row, Values, caution, note, stop
from eaid.shown import listed

STOOD_STILL = "the sensor stood still for {for_s:.3g} s at {at_s:.6g} s, at exactly {value:.4g} {unit}"
RAMPS = "the input takes {ramp_s:.3g} s to its new level, and {moved_pct:.0f} % of the change come before it is there: "


def _say_drift(v: Values) -> str:
    share = v.get("share_pct")
    of = f" ({share:.0f} % of the step)" if share is not None and share < 1000 else ""
    return f"drift before the step: {v['drift']:+.3g} {v['unit']} while idle{of}"


def _lasts(seconds: float) -> str:
    """A time as people say it."""
    for size, unit in ((86400, "days"), (3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"


def _time_unclear(v: Values) -> str:
    sign = {"us": "µs"}.get(v["likely"], v["likely"])
    return (
        f"{v['column']} rises by {v['usual']:.3g} a row, {v['span']:.4g} in all: {sign}, {_lasts(v['likely_s'])} in "
        f"all? say «units» time={v['likely']}, or time={v['own']} if it lasts {_lasts(v['own_s'])}"
    )


def _or_rest(v: Values) -> str:
    """What else makes an idle output fall, where a release was fitted."""
    tau2_s = v.get("release_s")
    return (
        f", or rest for longer, if it is what the step before has left (falls take τ2 = {tau2_s:.3g} s)"
        if tau2_s
        else ""
    )


def _other_shape(v: Values) -> str:
    name = {"one": "one exponential", "two": "two exponentials", "free": "another C", "overshoot": "an overshoot"}
    dead = f" behind a dead time of {v['dead_time_s']:.3g} s" if v["dead_time_s"] > 0 else ""
    return (
        f"the step to {v['levels']} asks for {name[v['shape']]}{dead}: RMSE {v['rmse']:.3g} instead of "
        f"{v['plain_rmse']:.3g}"
    )


ROWS: dict[str, Row] = {
    # Reading
    "rows-dropped": caution("«repair» dropped {dropped} of {count} rows", size="dropped", always=True),
    "columns-by-place": caution("its columns have no names: taken as {order}"),
    "level-contradicted": caution(
        "its name says level {level:g}, its input column goes to {found:g} {unit}: the column counts"
    ),
    "input-alternates": note(
        "the input alternates between plus and minus {level:g} {unit}: its size, which the output follows, is taken "
        "for what drives it"
    ),
    "input-is-a-switch": caution(
        "{column} goes to {top:.4g} {unit} in all logs, whose names tell different levels: taken for the switch that "
        "tells when they step"
    ),
    "unit-assumed": note(
        lambda v: (
            f"no unit is given for {v['column'] if v['column'] == v['role'] else v['role'] + ' ' + v['column']}: "
            f"{v['unit']} assumed; say it with «units» {v['role']}=UNIT"
        )
    ),
    "unit-unknown": caution(
        "no unit is given for {column}: the numbers stay as they are, in a.u. (arbitrary units); say it with «units» "
        "{ask}",
        rank=1,
    ),
    "unit-g-unclear": caution(
        "{role} {column} is in {unit}, an acceleration or a weight: its numbers stay as they are; a weight is said by "
        "«units» {role}=gf or kgf"
    ),
    "time-since-a-day": note("{column} counts {counts}, as its first stamp tells"),
    "columns-exchanged": stop(
        "{subject}: the output jumps to its end at once and stays there to the digit, while the input moves on: are "
        "their columns exchanged? say which is which with «columns» input=NAME,output=NAME"
    ),
    "time-unclear": stop(_time_unclear),
    "time-doubtful": caution(
        "no unit is given for {column}: in seconds its stamps lie {usual_s:.3g} s apart and the log takes {span_s:.4g} "
        "s; if it counts another unit, say «units» time={likely}, or «rate_hz» if it counts samples"
    ),
    "whole-seconds": caution(
        lambda v: (
            f"{v['column']} counts whole seconds, {v['usual_s']:.4g} a row: the log lasts {_lasts(v['span_s'])}; if it "
            f"counts ms ({_lasts(v['span_s'] / 1e3)} in all), say «units» time=ms"
        ),
        always=True,
    ),
    "time-unit-differs": stop(
        "no unit is given for its time, and its stamps lie {usual_s:.4g} apart, those of other logs {others_s:.4g}: "
        "they count in different units; say «units» time=UNIT and read those of each unit apart"
    ),
    "torque-too-large": stop(
        "the torque reaches {largest:.4g} N·m, beyond any clutch: counts, or another unit; say «units» output=UNIT"
    ),
    "input-in-fractions": stop(
        "its input stays within 1 while that of other logs goes to {other:g} %: a fraction is read apart with «units» "
        "input=fraction; if all are in %, say «units» input=%"
    ),
    "run-given-twice": caution("{subject} and {other} hold the same values, as no two recordings do: they count once"),
    "input-may-be-active-low": caution(
        "its output rises where its input falls from {at}: if that is the input at rest, say «rest»"
    ),
    # Steps
    "other-shape-fits-better": caution(_other_shape, "saved_pct", rank=0),
    "step-leaves-open": note("the step to {levels} leaves open: {open}"),
    "several-edges": stop(
        lambda v: (
            f"the output has {v['edges']} edges, the first at {v['first_s']:.4g} s, the last at {v['last_s']:.4g} s: "
            "several steps, or a closed loop, and not one step; give "
            + "the input column, " * (not v.get("has_input"))
            + "a «columns» position= that reverses, or one edge with «step_at» and «until»"
            + ", and its level with «name_pattern»" * (not v.get("has_input"))
        ),
        "edges",
    ),
    "cut-at-reversals": note(
        "cut at the {reversals} turns of its position, each a step from the output at the turn; strokes back count as "
        "negative inputs"
    ),
    "input-switches": stop(
        "the input goes to and fro every {rows:.2g} rows, as the square wave of a drive does and no level: say the "
        "level with «name_pattern» and take another input, or none, with «columns»; or «logs_as» recorded if "
        "that is meant"
    ),
    "input-moves": stop(
        "the input moves most of the time, so it holds no steps; a displacement is said with «columns» position=, "
        "beside the load as input=; else eaid fit takes such a log whole, as it was recorded («logs_as» recorded asks "
        "for it); for steps, hold each level"
    ),
    "input-negative": note("the input is negative: its size is taken"),
    "short-pieces": note("{pieces:#shorter piece} of fewer than {fewest} samples left out"),
    "step-from-output": note(
        "step instant {step_s:.6g} ± {error_s:.2g} s found from the output alone: no dead time shows in it"
    ),
    "let-go-from-output": note(
        "the output falls for good at {at_s:.6g} s, found from it alone: the step ends there; «until» ends it elsewhere"
    ),
    "step-from-command": note("step instant {step_s:.6g} s taken from {column}, which is switched on there"),
    "moves-with-step": caution(
        "{column} moves with the step: if that loads the output, the rise and its time constants are those of the "
        "loading, not of the input",
        rank=0,
    ),
    "step-at-first-sample": caution(
        "the output rises from the first sample on, which is taken for the step, and its value there, {start:.4g} "
        "{unit}, for the start; if the step came later, say «step_at»"
    ),
    "no-rest-before-step": caution(
        "nothing is recorded before the step: its first samples, {start:.4g} {unit}, are taken for its start; if it is "
        "another, say «baseline»"
    ),
    "broken-off": stop("ends {own_s:.3g} s behind its step, and its repeats {usual_s:.3g} s"),
    "spikes-before-step": caution("{samples:#spike} before the step left out of its baseline", "samples"),
    "input-glitches": caution(
        "the input leaves its level on {rows:#row} from {at_s:.6g} s on and comes back: a glitch, and no step", "rows"
    ),
    "output-renewed": caution(
        "the output is renewed every {rows:#row} only ({every_s:.3g} s): time constants and dead times up to that are "
        "the sensor's; log at its rate",
        "every_s",
    ),
    "spikes": stop(
        "{samples:#row} far out of the record, the largest {value:.4g} {unit} at {at_s:.6g} s: no fit holds with them; "
        "«repair» drops such rows, up to 1 % of a log",
        "value",
        refit="--repair",
    ),
    "gap": caution("gap of {gap_s:.4g} s in the record at {at_s:.6g} s (usual sample time {sample_s:.4g} s)", "gap_s"),
    "changes-in-gaps": stop(
        "{subject}: {count} changes of its input lie within gaps, nobody knows when: the times of its responses are "
        "lost; record it without gaps"
    ),
    "log-in-parts": caution(
        "{subject}: its input changed within a gap, nobody knows when: it counts as {parts} logs, each with its own "
        "start"
    ),
    "step-in-gap": stop(
        "the step falls into a gap of {gap_s:.4g} s of the record at {at_s:.6g} s, and {moved_pct:.0f} % of the change "
        "came within it: nobody knows when it began; record it again, or give its instant with «step_at»",
        "moved_pct",
    ),
    "input-ramps": caution(
        RAMPS + "its time constants are those of the rest; log the command, or a faster input", "moved_pct"
    ),
    "input-ramps-on": stop(
        RAMPS + "no step shows its time constants; fit the log as it was recorded («logs_as» recorded), or log the "
        "command",
        "moved_pct",
        refit="--logs-as recorded",
    ),
    "idle-drifts": caution(_say_drift, "share_pct", rank=1),
    "creep-taken-off": caution(
        lambda v: (
            f"the output creeps by {v['rate']:+.3g} {v['unit']}/s ({v['low']:+.3g} … {v['high']:+.3g}) beside its "
            f"response, in all runs alike; the fit is without that creep: let the sensor warm up{_or_rest(v)}"
        ),
        rank=1,
    ),
    "fade-taken-off": caution(
        "the output fades by {pct:.3g} % ({low:.3g} … {high:.3g}) in a hold of {hold_s:.3g} s, at all levels alike, as "
        "that of discs that warm up does; the fit is without that fade, T_s that of the begin of a hold: let the discs "
        "cool between holds, or warm up before them",
        rank=1,
    ),
    "fade-possible": caution(
        "the runs ask for another C, or for an output that fades by {pct:.3g} % ({low:.3g} … {high:.3g}) in a hold of "
        "{hold_s:.3g} s, as that of discs that warm up does: these logs do not tell which, and τ2 is longer with a "
        "fade; hold one level for longer, and see whether its output falls",
        rank=1,
    ),
    "log-differs": caution(
        "{subject}: its output lies {off_pct:+.2g} % off that of the other logs, more than within logs: another day, "
        "or mounted anew? Fit each by itself, and compare them",
        rank=0,
    ),
    "gain-drifts": caution(
        "{subject}: its output changes by {pct:+.2g} % from its start to its end at one input, as if the clutch warmed "
        "up: the fit is of the gain in its middle; record it warmed up",
        rank=0,
    ),
    "zero-jumps": caution(
        "{subject}: {at_s:.5g} s after its start the output jumps by {size:+.3g} {unit}, and stays there, which no "
        "input makes: a sensor's zero that moved, or another load; the fit is without it: see what happened then",
        rank=0,
    ),
    "log-creeps": caution(
        "the output creeps by {end:+.3g} {unit} ({low:+.3g} … {high:+.3g}) from the start of the log to its end "
        "({middle:+.3g} amid it) beside its response; the fit is without that creep: let the sensor warm up",
        rank=1,
    ),
    "output-creeps": caution(
        lambda v: (
            f"the output creeps by {v['slope']:+.3g} {v['unit']}/s while it idles, alike before {v['count']} steps: "
            f"{v['share_pct']:.2g} % of the step to {v['worst']:g} by the end of its hold; T_s, τ2 and the C that the "
            f"runs ask for hold that creep: let the sensor warm up{_or_rest(v)}, and record again"
        ),
        "share_pct",
        rank=0,
        covers=("runs-reject-the-share",),
        first="record again without that creep",
    ),
    "not-at-rest": stop(
        "not at rest when the step begins: {off:+.3g} {unit} off the idle output, {share_pct:.0f} % of the step; let "
        "it rest before the step, mend «step_at» where the input was logged late, or say what it starts from with "
        "«baseline»",
        "share_pct",
    ),
    "unsettled-before-step": stop(
        "the output still moves when the input goes from {levels}, by {share_pct:.0f} % of the change that follows: "
        "hold each level until it rests, or log the input in time",
        "share_pct",
    ),
    "saturated": stop("sensor saturated? {samples:#sample} at {limit:.4g} {unit}", "samples"),
    "flat-topped": caution(
        "the output stops at {limit:.4g} {unit} at full slope and stays there: a saturated sensor, or a contact that "
        "slips; either way its time constants are those of the loading",
        rank=0,
    ),
    "idle-at-limit": caution(
        "the idle output stands at {limit:.4g} {unit}, to the last digit, where falls end at full slope: the sensor "
        "ends there, and T_s is short by what the idle output lies behind it; shift the zero of the sensor",
        rank=0,
    ),
    "sensor-stuck": stop(STOOD_STILL + "; record it again", "for_s"),
    "sensor-stuck-briefly": caution(STOOD_STILL, "for_s"),
    "block-written-twice": stop(
        "{rows} rows from {at_s:.6g} s on come again at {again_s:.6g} s to the last digit, as noise never does: a "
        "block was written twice, and what follows may be late by it; save each row once, or end the window before "
        "with «until»",
        "rows",
    ),
    "coarse-output": stop(
        "the output moves in steps of {resolution:.3g} {unit}, {steps:.0f} of them in the whole change: too coarse to "
        "tell time constants; use a finer range of the sensor"
    ),
    "left-after-release": caution(
        "{left_pct:.0f} % of the held output is left {after_s:.3g} s after the release", "left_pct"
    ),
    "level-contradicts-input": stop(
        "its level is said to be {said:g} {unit}, but its own input column holds {held:.4g}; mend one of them"
    ),
    "repeats-disagree": caution(
        lambda v: (
            f"repeats disagree {v['at']}: their outputs at the end differ by {v['spread_pct']:.0f} %"
            + (f", {v['subject']} by {round(v['own_pct']):+d} % from the others" if "own_pct" in v else "")
        ),
        "own_pct",
    ),
    "repeats-scatter": caution(
        "the outputs of repeats scatter by {sd_pct:.2g} % at the end (standard deviation, {runs} runs)", "sd_pct"
    ),
    "duty-may-be-fraction": caution(
        "no level is above 1 %: if the duty is a fraction of 1, say «units» input=fraction, if it is in %, input=%"
    ),
    "level-to-level": note(
        "{steps} of {of} steps go from one level to another: each is fitted from its own start, apart from the steps "
        "from rest"
    ),
    "rests-elsewhere": caution(
        "all logs begin at {rest:.3g} {unit}: {steps} of {of} steps count as steps from that level, only the others as "
        "steps from rest; if the rig rests there, say «rest» {rest:.3g}",
        refit="--rest {rest:.3g}",
    ),
    "shape-explains-little": caution(
        "the best of the step shapes ({shape}) explains {R2:.0%} of the output's variance only: that step by itself is "
        "no step response"
    ),
    "shape-misses": caution(
        "the best of the step shapes misses the step to {levels} by up to {share_pct:.0f} % of its change: what "
        "swings, ramps or jumps is no sum of exponentials; read its constants as times only",
        "share_pct",
    ),
    "sign-differs": stop(
        "its output goes the other way than that of {siblings:#run} beside it; mend its sign or its wiring, or leave "
        "it out"
    ),
    "runs-left-out": caution(
        lambda v: f"{len(v['runs'])} of {v['of']} runs left out of the fit, {listed(v['runs'], 3)}: {v['why']}",
        always=True,
        rank=1,
    ),
    "rest-unnamed": caution(
        "all logs step from {rest:.4g} {unit} and come back to it: if the rig rests there, say «rest» {rest:.4g}, and "
        "levels, T_s and the idle output count from there",
        rank=1,
        covers=("idle-not-seen", "rest-not-seen"),
        refit="--rest {rest:.4g}",
    ),
    "several-factors": caution(
        lambda v: (
            f"the names of the logs differ in {v['key']} too, {listed(v['values'], 6)}: all are taken together; choose "
            f"with «where» {v['key']}={v['first']}"
            + f", or take it for the level with «name_pattern» '{v['key']}={{level}}'"
            * bool(v.get("one"))
        ),
        always=True,
        rank=0,
    ),
    "levels-left-out": caution("what was recorded {at} is left out of the fit", always=True, rank=1),
    "signs-turned": caution(
        "the output falls at the step in {runs:#run}: the fit counts it upwards, with its sign turned; gains for this "
        "rig need the output, or the input, with the other sign too",
        always=True,
        rank=0,
    ),
}
