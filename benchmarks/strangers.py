"""Rigs that `eaid synth` cannot make, fitted as a newcomer would: is the answer right, told, refused or wrong?

`python -m benchmarks.strangers [NAME …]`: plants simulated by `scipy.signal` (lags, ringing, dead time, integrators,
loops), behind backlash, limits, dead zones, drift, quantisation, coloured noise and hum, under headers, units and
rates of their own. `eaid fit LOG` is run, then what it prints after `try:`; a fit that is usable is tuned and replayed.

right    `fit.predict` is within 5 % of the true step response (root mean square over the steady value)
told     a stop, or not right, or nothing to be right about, and a caution names the trouble
refused  exit code 2 or 3 with one sentence
WRONG    anything else; `slow`: above 20 s of processor time
"""

import json
import os
import re
import resource
import shlex
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import signal

import eaid
from benchmarks.table import asked
from eaid.arrays import Array
from eaid.errors import EaidError

SLOW_S = 20.0
System = tuple[list[float], list[float]]
"""Numerator and denominator in s."""


@dataclass(frozen=True)
class Made:
    """Logs by name; an input, times, and the true output of a step to it, in the unit that a fit has it in."""

    logs: dict[str, pd.DataFrame]
    truth: tuple[float, Array, Array] | None = None
    words: str = ""
    """What a caution that names the trouble says; empty: there is none."""
    columns: str = ""
    """What a newcomer answers where columns are asked for and no command is proposed."""
    csv: dict[str, str] = field(default_factory=dict)
    """Arguments of `to_csv`."""


def lag(tau: float, gain: float = 1.0) -> System:
    """One lag."""
    return [gain], [tau, 1.0]


def ringing(omega: float, zeta: float, gain: float = 1.0) -> System:
    """A spring."""
    return [gain], [1 / omega**2, 2 * zeta / omega, 1.0]


def clutch(level: float) -> System:
    """70 % fast, the rest slow; the force in g goes with the square of the level in V."""
    fast, slow = lag(0.2, 0.7 * 0.01 * level), lag(3.0, 0.3 * 0.01 * level)
    over = np.polyadd(np.polymul(fast[0], slow[1]), np.polymul(slow[0], fast[1]))
    return list(over), list(np.polymul(fast[1], slow[1]))


def run(system: System, t: Array, u: Array, dead: float = 0.0, fine: int = 20) -> Array:
    """The output on the log's own clock, input held between rows, a dead time later."""
    dt = (t[1] - t[0]) / fine
    held = np.repeat(u, fine)
    late = np.concatenate([np.full(round(dead / dt), u[0]), held])[: held.size]
    made: Any = signal.cont2discrete(system, dt)  # type: ignore[arg-type]
    return np.asarray(signal.lfilter(np.squeeze(made[0]), made[1], late - u[0])[::fine])


def truth(system: System, u: float, w: float, dead: float, unit: float) -> tuple[float, Array, Array]:
    """The true step response to `u`, which acts as `w`, over ten time constants."""
    end = dead + 10 / min(abs(np.roots(system[1])))
    t = np.linspace(0, end, 400)
    at, y = signal.step(system, T=np.linspace(0, end, 4000))
    return u, t, np.interp(t - dead, at, y, left=0.0) * w * unit


def steps(levels: tuple[float, ...], hold: float, dt: float, end: float, seed: int = 0) -> tuple[Array, Array]:
    """Random holds of one to two times `hold`, after a second at 0."""
    random, t = np.random.default_rng(seed), np.arange(0, end, dt)
    u, at = np.zeros(t.size), 1.0
    while at < end:
        u[t >= at] = random.choice([one for one in levels if one != u[-1]])
        at += hold * random.uniform(1, 2)
    return t, u


def noise(n: int, sd: float, seed: int = 1, memory: float = 0.0) -> Array:
    """White, or of first order with a memory in rows."""
    keep = np.exp(-1 / memory) if memory else 0.0
    white = np.random.default_rng(seed).normal(size=n)
    return sd * np.sqrt(1 - keep**2) * np.asarray(signal.lfilter([1], [1, -keep], white))


def frame(names: str, *columns: Array) -> pd.DataFrame:
    """Columns under names."""
    return pd.DataFrame(dict(zip(names.split(","), columns, strict=True)))


def moving(
    names: str,
    levels: tuple[float, ...],
    hold: float,
    system: System,
    sd: float,
    at: float | None,
    *,
    dead: float = 0.0,
    before: Callable[[Array], Any] = np.asarray,
    after: Callable[[Array, Array], Array] = lambda t, y: y,
    rows: Any = slice(None),
    dt: float = 0.02,
    end: float = 80.0,
    u: Callable[[Array], Any] | None = None,
    memory: float = 0.0,
    unit: float = 1.0,
    **more: Any,
) -> Made:
    """One log of random steps, or of any input: input → `before` → system → noise → `after`."""
    t, given = steps(levels or (0.0, 1.0), hold, dt, end)
    given = np.asarray(u(t)) if u else given
    y = after(t, run(system, t, before(given), dead) + noise(t.size, sd, memory=memory))
    log = frame(names, t, given, y).iloc[rows]
    true = None if at is None else truth(system, at, float(before(np.array([at]))[0]), dead, unit)
    return Made({"log.csv": log}, true, **more)


def stepped(
    names: str,
    levels: tuple[float, ...],
    hold: float,
    system: Callable[[float], System],
    sd: float,
    at: float | None,
    *,
    dt: float = 0.01,
    rest: float = 1.0,
    clock: float = 1.0,
    after: Callable[[Array, Array], Array] = lambda t, y: y,
    unit: float = 1.0,
    **more: Any,
) -> Made:
    """One log a level: rest, the level, the end."""
    logs = {}
    for k, level in enumerate(levels):
        t = np.arange(0, rest + hold, dt)
        u = np.where(t >= rest - dt / 2, level, 0.0)
        y = after(t, run(system(level), t, u) + noise(t.size, sd, seed=k))
        logs[f"{k}_{level:g}.csv"] = frame(names, t * clock, u, y)
    return Made(logs, None if at is None else truth(system(at), at, at, 0.0, unit), **more)


def play(width: float) -> Callable[[Array], Array]:
    """Backlash of a width."""

    def through(u: Array) -> Array:
        out, at = np.zeros(u.size), 0.0
        for k, one in enumerate(u):
            at = out[k] = min(max(at, one - width / 2), one + width / 2)
        return out

    return through


def up_and_down() -> Made:
    """Rises with 0.2 s, falls with 0.8 s."""
    t, u = steps((0, 1, 2, 3), 2.5, 0.02, 90.0)
    y = np.zeros(t.size)
    for k in range(1, t.size):
        y[k] = u[k - 1] + (y[k - 1] - u[k - 1]) * np.exp(-0.02 / (0.2 if u[k - 1] > y[k - 1] else 0.8))
    log = frame("time_s,current_A,torque_Nm", t, u, y + noise(t.size, 0.02))
    return Made({"log.csv": log}, truth(lag(0.2), 2, 2, 0, 1))


def loop(names: str, sd: float, words: str) -> Made:
    """A PI on one lag; the reference is logged where it has a name."""
    (t, r), x, total, keep = steps((1, 2, 3, 4), 3.0, 0.02, 120.0, seed=3), 0.0, 0.0, np.exp(-0.02 / 0.6)
    u, y = np.zeros(t.size), noise(t.size, sd)
    for k in range(t.size):
        y[k] += x
        total += 3.0 * 0.02 * (r[k] - y[k])
        u[k] = 2.0 * (r[k] - y[k]) + total
        x = keep * x + 0.5 * (1 - keep) * u[k]
    columns = (t, r, u, y) if "setpoint" in names else (t, u, y)
    return Made({"log.csv": frame(names, *columns)}, truth(lag(0.6, 0.5), 4, 4, 0, 1), words)


def second_input() -> Made:
    """A second command, logged too, moves the output as well."""
    (t, a), (_, b) = steps((0, 1, 2), 1.5, 0.02, 90.0), steps((0, 1, 2), 2.1, 0.02, 90.0, seed=8)
    y = run(lag(0.4, 2), t, a) + run(lag(0.8, 1), t, b) + noise(t.size, 0.03)
    log = frame("time_s,u1_V,u2_V,force_N", t, a, b, y)
    return Made({"log.csv": log}, truth(lag(0.4, 2), 1, 1, 0, 1), "u2|other|second", "input=u1_V")


def coulomb() -> Made:
    """A motor with dry friction of 0.6 V under random steps of both signs."""
    (t, u), w, dt = steps((-3, -2, -1, 0, 1, 2, 3), 1.0, 0.01, 60.0), 0.0, 0.001
    y = np.zeros(t.size)
    for k in range(t.size):
        y[k] = w
        for _ in range(10):
            drive = u[k] - 0.1 * w
            after = w + dt / 0.02 * (drive - (np.sign(w) * 0.6 if abs(w) > 1e-3 else np.clip(drive, -0.6, 0.6)))
            w = 0.0 if w * after < 0 and abs(u[k]) <= 0.6 else after
    said = frame("time_s,motor_V,speed_rad_s", t, u, y + noise(t.size, 0.2))
    return Made({"log.csv": said}, truth(lag(0.2, 10), 3, 2.4, 0, 1), "curve|dead zone|friction|follows the input")


def dropping(t: Array, y: Array) -> Array:
    """Every hundredth row reads 0."""
    return np.where(np.random.default_rng(2).random(t.size) < 0.01, 0.0, 5 + y)


def stairs(t: Array) -> Array:
    """Up in eight stairs and down again."""
    return 0.25 * np.minimum(np.floor(t / 6), np.floor(np.abs(114 - t) / 6)).clip(0, 8)


SHORT, ZEROES = ([1.0], [0.24, 1.1, 1.0]), ([-0.8, 1.0], [1.0, 2.0, 1.0])
SIGNED = (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0)
JITTER = np.sort(np.random.default_rng(5).choice(30_000, 3000, replace=False))
LIMIT, DRIFT = "limit|saturat|flat|clipp", "drift|idle|wander|hold-out"
HYSTERESIS, CODES = "hyster|backlash|path", "quanti|codes|resolution"

RIGS: dict[str, Callable[[], Made]] = {
    "heater": lambda: moving("Time (s),Heater [%],Temperature [°C]", (), 1, lag(120, 0.6), 0.1, 40, dead=9, dt=1.0,
        end=900, u=lambda t: 40.0 * (t >= 30), after=lambda t, y: np.round(21.5 + y, 2)),
    "motor_folder": lambda: stepped("t_ms,U [V],n [rpm]", (3, 3, 6, 6, 9, 9, 12, 12), 2, lambda _: lag(0.12, 105),
        4, 9, dt=0.005, clock=1e3),
    "two_lags_series": lambda: moving("time,valve_V,pressure_kPa", (0, 1, 2, 3), 2, SHORT, 0.02, 2, after=lambda t,
        y: 100 + y, unit=0.01),
    "ringing_folder": lambda: stepped("Time [s],Current [A],Position [mm]", (0.5, 1, 1.5, 2), 3,
        lambda _: ringing(12, 0.15, 3), 0.02, 1.5, dt=0.002),
    "ringing_recorded": lambda: moving("t,force_N,x_mm", (-1, 0, 1), 0.8, ringing(9, 0.25, 2), 0.03, 1, dt=0.01,
        end=40, columns="input=force_N,output=x_mm"),
    "dead_recorded": lambda: moving("time_s,pump [%],flow [l/min]", (0, 20, 50, 80), 3, lag(1.5, 0.3), 0.1, 50,
        dead=0.67, dt=0.05, end=120),
    "drift_recorded": lambda: moving("time_s,input_V,force_N", (0, 1, 2), 1.5, lag(0.5, 2), 0.03, 1, after=lambda t,
        y: y + t / 40, words=DRIFT),
    "drift_folder": lambda: stepped("time_s,duty_pct,torque_nm", (20, 40, 60, 80), 6, lambda _: lag(0.3, 0.02),
        0.004, 60, rest=2, after=lambda t, y: y + 0.02 * t, words=DRIFT),
    "quantised": lambda: stepped("time_s,volts,force_N", (1, 2, 3, 4), 3, lambda _: lag(0.25, 3), 0.05, 3,
        after=lambda t, y: np.round(y / 0.25) * 0.25, words=CODES),
    "quantised_recorded": lambda: moving("time_s,dac_V,adc_V", (0, 1, 2, 3), 1.5, lag(0.4), 0, 2, after=lambda t,
        y: np.round(y / 0.4) * 0.4, words=CODES, columns="input=dac_V,output=adc_V"),
    "two_speeds": lambda: stepped("ms,HV (V),Force (g)", (100, 100, 150, 150, 200, 200, 250, 250, 300, 300), 12,
        clutch, 4, 200, dt=0.005, clock=1e3, unit=9.80665e-3, columns='input="HV (V)"'),
    "up_and_down": up_and_down,
    "backlash": lambda: moving("time_s,command [V],angle [deg]", SIGNED, 1.5, lag(0.3, 5), 0.1, None,
        before=play(2.0), words=HYSTERESIS),
    "hysteresis": lambda: moving("time_s,voltage_V,stroke_um", (), 1, lag(0.05), 0.1, None, dt=0.05, end=100,
        u=lambda t: 50 * (1 - np.abs((t / 10) % 2 - 1)) * np.where(t < 50, 1, 1.6),
        before=lambda u: (play(5)(u) + play(15)(u) + play(30)(u)) / 3, words=HYSTERESIS),
    "sensor_limit": lambda: stepped("time_s,duty_pct,torque_nm", (20, 40, 60, 80), 4, lambda _: lag(0.6, 0.2), 0.05,
        None, after=lambda t, y: np.minimum(y, 10), words=LIMIT),
    "clipped_input": lambda: moving("time_s,command_V,speed_rad_s", (0, 1, 3, 5, 7, 9), 1.5, lag(0.3, 10), 0.5, 9,
        before=lambda u: np.minimum(u, 5), words=LIMIT),
    "coloured": lambda: moving("time_s,u_V,y_N", (0, 1, 2), 2, lag(0.4, 2), 0.3, 1, memory=16, end=120),
    "loop_with_reference": lambda: loop("time_s,setpoint_N,u_V,force_N", 0.02, "loop"),
    "loop_without_reference": lambda: loop("time_s,u_V,force_N", 0.1, "loop"),
    "integrator": lambda: moving("time_s,flow,level_cm", (-2, -1, 0, 1, 2), 3, ([0.8], [1.0, 0.0]), 0.1, None,
        dt=0.1, end=200, words="integrat"),
    "chirp": lambda: moving("Time,Input (V),Output (N)", (), 1, lag(0.15, 4), 0.1, 2, dead=0.02, dt=0.005, end=60,
        u=lambda t: 2 + 1.5 * signal.chirp(t, 0.05, 60, 5), after=lambda t, y: 8 + y),
    "multisine": lambda: moving("time_s,in_V,out_mm", (), 1, SHORT, 0.03, 3,
        u=lambda t: 3 + 0.5 * sum(np.sin(2 * np.pi * f * t + f * 9) for f in (0.05, 0.13, 0.31, 0.7, 1.3)),
        columns="input=in_V,output=out_mm"),
    "wrong_way": lambda: moving("time_s,valve [%],level [mm]", (0, 20, 40), 5, ZEROES, 0.1, 20, dt=0.05, end=120),
    "jitter": lambda: moving("timestamp,cmd_V,force_N", (0, 1, 2, 3), 1.5, lag(0.35, 2), 0.05, 2, dt=0.002, end=60,
        rows=JITTER),
    "slow_sensor": lambda: moving("time_s,u_V,load_kg", (0, 1, 2), 1.5, lag(0.25, 2), 0.03, 1, dt=0.01,
        after=lambda t, y: y[np.arange(t.size) // 10 * 10], words="holds|renew|rows long", unit=9.80665),
    "late_input": lambda: moving("time_s,u_V,force_N", (0, 1, 2, 3), 1, lag(0.1, 2), 0.03, 2, dt=0.01,
        after=lambda t, y: np.append(y[2:], y[-2:]), words="before"),
    "squared": lambda: moving("Zeit [s],Spannung [kV],Kraft [N]", (), 1, lag(0.5, 2e-6), 0.03, 1500, u=stairs,
        before=lambda u: np.where(u < 10, u * 1e3, u) ** 2, csv={"sep": ";", "decimal": ","}, end=120),
    "dead_zone": lambda: moving("time_s,pwm_V,speed_rpm", (0, 1, 2, 3, 4, 5, 6), 1.5, lag(0.25, 100), 3, 5,
        before=lambda u: np.maximum(u - 2, 0), words="curve|dead zone", end=90),
    "disturbed": lambda: moving("time_s,u_V,torque_nm", (0, 1, 2, 3), 2, lag(0.5, 2), 0.05, 2, after=lambda t,
        y: y + 2 * (t > 40), words=DRIFT),
    "falling": lambda: moving("time_s,closing_V,flow_lpm", (0, 1, 2, 3), 2, lag(0.7, -6), 0.2, 2, after=lambda t,
        y: 30 + y),
    "level_tau": lambda: stepped("time_s,duty_pct,torque_nm", (20, 40, 60, 80, 100), 6, lambda u: lag(20 / u, 0.05),
        0.03, 60),
    "dropouts": lambda: moving("time_s,u_V,force_N", (1, 2, 3), 1.5, lag(0.4, 2), 0.03, 2, after=dropping,
        words="spike|outlier"),
    "second_input": second_input,
    "too_short": lambda: stepped("time_s,u_V,temp_C", (1, 2, 3, 4), 10, lambda _: lag(30, 8), 0.05, 3, dt=0.05,
        rest=2, words="short|longer|beyond"),
    "coulomb": coulomb,
    "hum": lambda: moving("time_s,CH1 (V),CH2 (N)", (0, 1, 2), 0.8, lag(0.12, 3), 0.05, 1, dt=0.005, end=30,
        after=lambda t, y: y + 0.3 * np.sin(2 * np.pi * 50.3 * t)),
}  # fmt: skip


def write(made: Made, where: Path) -> Path:
    """The log, or the folder of them."""
    where.mkdir(parents=True, exist_ok=True)
    for name, log in made.logs.items():
        log.to_csv(where / name, index=False, float_format="%.6g", **made.csv)  # type: ignore[call-overload]
    return where if len(made.logs) > 1 else where / next(iter(made.logs))


def said(*words: str) -> tuple[int, str]:
    """A command's exit code and all that it says."""
    own = {**os.environ, "PYTHONPATH": os.getcwd()}
    call = [sys.executable, "-m", "eaid", *words]
    done = subprocess.run(call, capture_output=True, text=True, check=False, cwd=tempfile.gettempdir(), env=own)
    return done.returncode, done.stdout + done.stderr


def attempt(log: Path, columns: str, out: Path) -> tuple[int, str, list[str]]:
    """`eaid fit LOG`, then what it prints after `try:`, or the columns where it asks for them, four times at most."""
    words = ["fit", str(log)]
    for _ in range(4):
        code, text = said(*words, "-o", str(out), "--force")
        found = re.search(r"try: eaid (.*)", text)
        after = shlex.split(found[1]) if found else words
        if code == 3 and not found and columns and "--columns" not in words and "column" in text:
            after = [*words, "--columns", columns]
        if code in (0, 4) or after == words:
            break
        words = after
    return code, text, words


def downstream(log: Path, out: Path) -> str:
    """Gains of a usable fit, and its replay of a log that it was made from."""
    tuned, _ = said("tune-rc", str(out), "-o", f"{out}.gains", "--force")
    first = min(log.iterdir()) if log.is_dir() else log
    told, text = said("simulate", str(out), "--log", str(first), "-o", f"{out}.h5", "--force", "--json")
    found = re.search(r'"fit_pct": ([-\d.]+)', text)
    return f"tune-rc {tuned}, simulate --log {told} {f'{float(found[1]):.1f} %' if found else text.strip()[-120:]}"


def judged(made: Made, code: int, text: str, out: Path) -> tuple[str, str]:
    """The word for an outcome, and what is behind it."""
    if "Traceback" in text or code not in (0, 2, 3, 4):
        return "CRASH", text.strip().splitlines()[-1]
    if code in (2, 3):
        return "refused", next(line for line in text.splitlines() if line.startswith("error"))
    findings = json.loads(out.read_text(encoding="utf-8"))["findings"]
    why = ",".join(sorted({one["code"] for one in findings}))
    if first := re.search(r"^fit .*?%", text, re.MULTILINE):
        why = f"{first[0]}; {why}"
    error = np.nan
    if made.truth:
        u, t, y = made.truth
        try:
            found = np.ravel(eaid.load(out).predict(duty=u, t=t))  # type: ignore[union-attr, arg-type]
            error = float(np.sqrt(np.mean((found - y) ** 2)) / abs(y[-1]))
        except EaidError as refused:
            why = f"{refused}; {why}"
    told = made.words and any(one["severity"] != "note" and re.search(made.words, one["text"]) for one in findings)
    if code == 4:
        return "told", f"stop; off {100 * error:.1f} %; {why}"
    return ("right" if error < 0.05 else "told" if told else "WRONG"), f"off {100 * error:.1f} %; {why}"


def main(names: list[str], root: Path) -> Counter[str]:
    """Two lines a rig, then the counts."""
    counts: Counter[str] = Counter()
    for name in asked(names, 0, list(RIGS))[1]:
        made = RIGS[name]()
        log, out = write(made, root / name), root / f"{name}.json"
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        code, text, words = attempt(log, made.columns, out)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        took = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        word, why = judged(made, code, text, out)
        if code == 0:
            why += f"; {downstream(log, out)}"
        counts[word] += 1
        counts["slow"] += took > SLOW_S
        (root / f"{name}.txt").write_text(text, encoding="utf-8")
        print(f"{name:22s} {word:8s} exit {code} {took:5.1f} s  eaid {shlex.join(words)}\n    {why}", flush=True)
    print(", ".join(f"{count} {word}" for word, count in counts.items()))
    return counts


if __name__ == "__main__":
    main(sys.argv[1:], Path(tempfile.mkdtemp(prefix="strangers-")))
