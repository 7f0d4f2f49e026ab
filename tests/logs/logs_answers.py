"""Several hundred made logs and what `eaid.logs` answers to each, so that no limit of a reader moves unseen.

`python tests/logs/logs_answers.py` writes answers.json anew: only after a change that is meant, with a look at what
differs.
A refusal is kept as the options that its sentences name and the rows and columns in them, not as its words.
"""

import json
import re
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from eaid.logs.options import ReadOptions
from scipy.io import savemat

from eaid.arrays import read_only
from eaid.errors import EaidError
from eaid.logs.columns import kind_of
from eaid.logs.folders import manifest_of, plainly_no_log
from eaid.logs.foreign.hdf5 import read_hdf5
from eaid.logs.foreign.lvm import read_lvm
from eaid.logs.foreign.mat import read_mat
from eaid.logs.read import columns_told, differing_number, read_runs, together
from eaid.logs.run import Run
from eaid.logs.table import Table
from eaid.logs.text import read_text
from eaid.logs.to_run import Origin, run_of, seconds_since_start, time_scale
from eaid.logs.units import split_name, unit_of
from eaid.reading import is_recorded

FILE = Path(__file__).parent / "answers.json"
Random = np.random.Generator


def plain(value: Any) -> Any:
    """Numbers to seven digits, everything else as JSON has it."""
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.6e}") if np.isfinite(value) else repr(float(value))
    return value


def refused(fault: EaidError) -> list[Any]:
    """Options and numbers that a refusal names."""
    text = " ".join(fault.sentences)
    return ["refused", len(fault.sentences), sorted(set(re.findall("«(\\w+)»", text))), re.findall(r"row (\d+)", text)]


def of_run(run: Run) -> list[Any]:
    findings = [[one.code, *plain([v for v in one.values.values() if not isinstance(v, str)])] for one in run.findings]
    columns = [
        [float(np.nansum(one)), float(one[0]), float(one[-1])] if len(one) else []
        for one in (run.time_s, run.input, run.output, run.reference_nm, run.position)
        if one is not None
    ]
    facts = [run.name, run.level, run.repeat, run.step_s, run.until_s, run.start_s, run.kind, run.synthetic]
    return [*facts, run.input_unit, run.output_unit, run.position_unit, columns, run.taken, run.left, findings]


def answered(read: Callable[[], Any]) -> Any:
    try:
        return read()
    except EaidError as fault:
        return refused(fault)


CLOCKS = ("time", "Time [s]", "t_ms", "Zeit (ms)", "timestamp", "sample", "elapsed_us", "seconds", "T [degC]", "t", "s")
INPUTS = ("duty", "PWM %", "u", "Voltage [kV]", "Spannung in V", "current_A", "speed_rpm", "force_N", "throttle",
          "enable", "command", "pressure [mbar]", "Kraft", "", "note")  # fmt: skip
OUTPUTS = ("torque", "Torque (mNm)", "Drehmoment", "load cell_g", "Load Cell", "friction [N]", "y", "torque_nm",
           "TorqueMnm", "moment.ncm", "output", "torque1", "")  # fmt: skip
OTHERS = ("temperature", "torque_ref", "setpoint", "force", "rpm", "trigger", "position", "T2 [degC]", "index", "speed")


def signals(random: Random, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t = np.arange(count) * float(random.choice([0.005, 0.01, 0.01, 0.02, 1.0, 10.0, 1000.0, 2.0e-5]))
    t = t + float(random.choice([0.0, 0.0, 0.0, 25.0, 1.7e9, 1.7e12, 45000.0]))
    on = np.arange(count) >= count // 3
    u = np.where(on, float(random.choice([1.0, 0.5, 60.0, 100.0, 250.0])), 0.0)
    y = np.where(on, 1 - np.exp(-(np.arange(count) - count // 3).clip(0) / 30), 0.0)
    return t, u, y * float(random.choice([1.0, -2.5, 800.0, 1500.0])) + random.uniform(-0.1, 0.1)


def picked(random: Random, names: tuple[str, ...]) -> str:
    """One of the names, mostly the first."""
    return names[0] if random.uniform() < 0.7 else str(random.choice(names))


def stamp(seconds: float, form: int) -> str:
    minutes, s = divmod(seconds + 86360.0 * (form == 2), 60)
    hours, minutes = divmod(int(minutes), 60)
    clock = f"{hours % 24:02d}:{minutes:02d}:{s:06.3f}"
    return (f"2026-03-01 {clock}", f"1.3.2026 {clock}".replace(".0", ".0"), clock, f"2026-03-01T{clock}+02:00")[form]


def a_text(random: Random) -> str:
    """A text log in one of many dialects, sometimes with something wrong."""
    count = int(random.choice([8, 40, 120, 120]))
    t, u, y = signals(random, count)
    delimiter = str(random.choice([",", ";", "\t", "|", " "]))
    comma = delimiter != "," and random.uniform() < 0.4
    columns = [(picked(random, CLOCKS), t), (picked(random, INPUTS), u), (picked(random, OUTPUTS), y)]
    if random.uniform() < 0.08:
        del columns[int(random.integers(0, 3))]
    columns += [
        (str(random.choice(OTHERS)), random.choice([0.0, 1.0]) * u + 0.01 * random.normal(size=count))
        for _ in range(int(random.choice([0, 0, 1, 2])))
    ]
    order = random.permutation(len(columns)) if random.uniform() < 0.4 else np.arange(len(columns))
    columns = [columns[i] for i in order]
    stamped = int(random.integers(0, 12))
    rows = []
    for k in range(count):
        cells = []
        for name, values in columns:
            shown = f"{values[k]:.14g}" if name not in ("sample", "index") else str(k)
            if values is t and stamped < 4 and values[-1] < 1e6:
                shown = stamp(float(values[k]), stamped)
            cells.append(shown.replace(".", ",") if comma and ":" not in shown else shown)
        rows.append(cells)
    fault, at, place = int(random.integers(0, 36)), int(random.integers(2, count)), int(random.integers(len(columns)))
    if fault < 5:
        rows[at][place] = ("", "nan", "abc", "1e400", "-")[fault]
    elif fault == 5:
        rows[at] = rows[at][:-1]
    elif fault == 6:
        rows[at] = [*rows[at], "7"]
    elif fault == 7:
        rows[at][0] = rows[at - 1][0]
    elif fault == 8:
        rows[at], rows[at - 1] = rows[at - 1], rows[at]
    elif fault == 9:
        rows[at:at] = [["# a comment"]]
    elif fault == 10:
        rows.append(["end of log", *([""] * (len(columns) - 1))])
    elif fault == 11 and not comma:
        rows = [[cell if ":" in cell else f'"{cell}"' for cell in row] for row in rows]
    lines = [delimiter.join(row) for row in rows]
    head, names = int(random.integers(-3, 8)), [name for name, _ in columns]
    if head < 7:
        lines.insert(0, delimiter.join(names))
    if head == 1:
        lines.insert(1, delimiter.join(random.choice(["[s]", "-", "", "-"], len(columns))))
    elif head == 2:
        lines[:0] = ["# sampled at 500 Hz", "# operator: nobody"]
    elif head == 3:
        lines[:0] = ["Rig: bench 2", "dt = 0.002 s", ""]
    elif head == 4:
        lines[:0] = ["1,2,3", "4,5,6", "7,8,9"]
    ending = delimiter if random.uniform() < 0.1 and delimiter != " " else ""
    return str(random.choice(["\n", "\r\n", "\r"])).join(line + ending for line in lines) + "\n" * int(
        random.integers(0, 3)
    )


def options(random: Random) -> ReadOptions:
    """What a user may say, mostly nothing."""
    said = int(random.integers(0, 18))
    columns = ({"output": "3"}, {"input": "2", "output": "3"}, {"time": "1"}, {"position": "force"})
    units = ({"time": "ms"}, {"input": "/255"}, {"output": "mN·m"}, {"time": "/1000"}, {"input": "fraction"})
    if said < 4:
        return ReadOptions(columns=columns[said])
    if said < 9:
        return ReadOptions(units=units[said - 4])
    more = {9: {"rate_hz": 200.0}, 10: {"name_pattern": "_u={level}_r{repeat}"}, 11: {"step_at_s": 0.4, "until_s": 0.9},
            12: {"kind": "friction-force"}, 13: {"name_pattern": "_u={level}"}}.get(said, {})  # fmt: skip
    return ReadOptions(**more, repair=random.uniform() < 0.3)


def of_texts(random: Random, folder: Path) -> Any:
    path = folder / "log_u=60_r2.csv"
    encoding = str(random.choice(["utf-8", "utf-8", "utf-16", "cp1252", "utf-8-sig"]))
    path.write_bytes(a_text(random).encode(encoding, errors="replace"))
    asked, outcome = options(random), [plainly_no_log(path.rename(path.with_suffix(".log")))]
    path = path.with_suffix(".log")
    outcome.append(answered(lambda: [[*map(list, (one.columns, one.units))] for one in read_text(path, "log")]))
    return [*outcome, answered(lambda: of_run(read_runs([path], asked)[0]))]


def several(random: Random, folder: Path) -> Any:
    """Two to four logs of one call, some of them twice, in fractions, on and off only, or parts of one run."""
    paths, u = [], float(random.choice([0.5, 1.0, 1.4, 60.0, 100.0]))
    for k in range(int(random.integers(2, 5))):
        t = np.arange(60) / 20 + 3.0 * k * float(random.choice([0.0, 1.0]))
        on = np.where(t - t[0] > 1, u if random.uniform() < 0.7 else 60.0, 0.0)
        y = np.where(on > 0, random.uniform(0.5, 2.0), 0.0)
        name = ("time", str(random.choice(["duty_pct", "a", "pwm"])), "torque_nm")
        path = folder / f"test_{int(random.choice([3, 3, 4, 5])) * 10}V_{k}.csv"
        rows = [",".join(name), *(f"{a:.3f},{b:g},{c:.4f}" for a, b, c in zip(t, on, y, strict=True))]
        path.write_text("\n".join(rows if random.uniform() < 0.8 or not paths else paths[0].read_text().splitlines()))
        paths.append(path)
    asked = ReadOptions(join=random.uniform() < 0.4)

    def read() -> Any:
        runs = read_runs(paths, asked)
        return [[of_run(run) for run in runs], len(columns_told(runs))]

    return answered(read)


def tables(found: list[Table]) -> Any:
    def cells(table: Table) -> Any:
        cells = table.load(range(len(table.columns)))
        sums = [[len(one), float(np.nansum(one.astype(np.float64)))] for one in cells.values]
        return [
            table.name,
            table.columns,
            table.units,
            table.clock,
            table.dropped,
            sums,
            [list(map(str, (bad.row, bad.column))) for bad in cells.bad],
        ]

    return [cells(table) for table in found]


def arrays(random: Random) -> dict[str, Any]:
    """Vectors, matrices and settings that lie side by side."""
    count = int(random.choice([9, 10, 40]))
    t, u, y = signals(random, count)
    named: dict[str, Any] = {}
    for k in range(int(random.integers(1, 4))):
        shape = int(random.integers(0, 9))
        values = [t, np.stack([t, u, y]), np.stack([t, u, y], 1), np.stack([u, y], 1), 3.5, u[:5], t.reshape(-1, 1),
                  y + 1j * u, np.stack([u, y, t[::-1]])][shape]  # fmt: skip
        named[f"v{k}"] = values
    return named


def of_mat(random: Random, folder: Path) -> Any:
    path, named = folder / "a.mat", arrays(random)
    count = int(random.choice([12, 30]))
    if random.uniform() < 0.4:
        width = int(random.integers(1, 4))
        signal = {"values": np.arange(count * width, dtype=float).reshape(count, width)}
        signal |= {"label": random.choice(["torque", "a b"])} if random.uniform() < 0.6 else {}
        pair = [(signal["values"], signal.get("label", ""))] * 2
        named["S"] = {"signals": signal}
        if random.uniform() < 0.4:
            named["S"]["signals"] = np.array(pair, [("values", "O"), ("label", "O")])
        if random.uniform() < 0.8:
            named["S"]["time"] = np.arange(count) / 10
    savemat(path, named)
    return answered(lambda: tables(read_mat(path, "a")))


def of_hdf5(random: Random, folder: Path) -> Any:
    with h5py.File(folder / "a.h5", "w") as file:
        place = file.create_group("log") if random.uniform() < 0.5 else file
        for name, values in arrays(random).items():
            place[name] = values
            if random.uniform() < 0.3:
                place[name].attrs["units"] = "ms"
            if random.uniform() < 0.2 and np.ndim(values):
                place[name].attrs.update(scale_factor=2.0, add_offset=1.0, _FillValue=float(np.ravel(values)[0].real))
    return answered(lambda: tables(read_hdf5(folder / "a.h5", "a")))


def of_lvm(random: Random, folder: Path) -> Any:
    own, free = str(random.choice(["One", "Multi", "No"])), random.uniform() < 0.5
    lines = [
        "LabVIEW Measurement",
        "Separator\tTab",
        "Decimal_Separator\t.",
        f"X_Columns\t{own}",
        "***End_of_Header***",
    ]
    channels = ["Duty", "Torque"][: int(random.integers(1, 3))]
    for segment in range(int(random.integers(1, 3))):
        step = random.choice(["0.01", "0.01", "0"])
        lines += ["", f"Channels\t{len(channels)}", "Samples\t5\t5", f"Date\t2026/03/0{1 + segment}\t2026/03/01",
                  "Time\t10:00:00.5\t10:00:00.5", "X_Dimension\tTime\tTime", "X0\t0.5\t0.5",
                  f"Delta_X\t{step}\t0.01", "Y_Unit_Label\tV\tN", "***End_of_Header***"]  # fmt: skip
        names = [name for channel in channels for name in (("X_Value", channel) if own == "Multi" else (channel,))]
        names = names if own == "Multi" else ["X_Value", *names]
        lines.append("\t".join([*names, *(["Comment"] if free else [])]))
        for k in range(5):
            time = "" if own == "No" else f"{k / 100:.3f}"
            cells = [time if name == "X_Value" else f"{k * len(name)}.5" for name in names]
            if random.uniform() < 0.04:
                cells = cells[:-1]
            if random.uniform() < 0.04:
                cells[-1] = "x"
            lines.append("\t".join(cells) + ("\tnoted" if random.uniform() < 0.1 else ""))
    path = folder / "a.lvm"
    path.write_text("\n".join(lines) + "\n")
    return answered(lambda: tables(read_lvm(path, "a")))


def of_frames(random: Random, _: Path) -> Any:
    """Tables of typed columns: unsigned and boolean ones, stamps in ns, short and constant ones."""
    count = int(random.choice([5, 25, 60]))
    t, u, y = signals(random, count)
    names = (
        str(random.choice(CLOCKS)),
        str(random.choice(INPUTS)),
        str(random.choice(OUTPUTS)),
        str(random.choice(OTHERS)),
    )
    last: np.ndarray = random.choice([0.0, 1.0]) * (u > 0)
    if random.uniform() < 0.2:
        last[::3] = 0.7
    values = (t, u.astype(random.choice(["u1", "f8", "bool"])), y, last)
    scale = float(random.choice([1.0, 1e3]))
    from eaid.logs.table import Cells

    table = Table("", names, lambda wanted: Cells(tuple(values[i] for i in wanted)), ("", "", "", ""), said={"a": "b"})
    pattern = "_u={level}" if random.uniform() < 0.3 else None
    asked = replace(options(random), name_pattern=pattern)
    clocks = answered(lambda: seconds_since_start("a", names[0], t * scale, time_scale("a", None, names[0], ""))[1:])
    clocks = clocks if clocks[0] == "refused" else [clocks[0], [[one.code] for one in clocks[1]]]
    return [clocks, answered(lambda: of_run(run_of(Origin("a", "a", "0", "log_u=40,5_r1"), [table], asked)))]


def of_moves(random: Random, _: Path) -> Any:
    count = int(random.choice([9, 100, 900]))
    holds = random.choice([0.0, 0.0, 20.0, 50.0, 51.0, 53.0], int(random.integers(1, 14)))
    u = np.repeat(holds, 1 + count // len(holds))[:count]
    u = u + float(random.choice([0.0, 0.5, 3.0])) * random.normal(size=len(u))
    unit = str(random.choice(["%", "V"]))
    run = Run("a", read_only(np.arange(len(u)) / 100), read_only(u), read_only(u), unit, "N·m", "a", "0", kind="clutch")
    return [
        is_recorded(run),
        is_recorded(run, 20.0),
        [of_run(one)[-1] for one in together([run, replace(run, sha256="1")], [], ReadOptions())[0]],
    ]


def of_names(random: Random, _: Path) -> Any:
    name = str(random.choice([*CLOCKS, *INPUTS, *OUTPUTS, *OTHERS]))
    unit = str(
        random.choice(["", "_ms", " [kV]", "(N*m)", "/N", " in mbar", "Nm", ".gf", "MPa", "_rad/s", "%", "_lbf"])
    )
    bare, spelled = split_name(name + unit)
    known = unit_of(spelled) if spelled else None
    other = differing_number([f"{name}_{k}V_a{random.integers(0, 2)}" for k in random.integers(0, 3, 3)])
    return [bare, spelled, known and list(known), kind_of(name + unit, ""), other]


def of_manifests(random: Random, folder: Path) -> Any:
    (folder / "a.csv").write_text("time,duty,torque\n0,0,0\n")
    more = str(random.choice(["", "", "", "", "level = 4.5\nrepeat = 2", "repeat = 1.5", "odd = 1", "step_s = true"]))
    entry = 'file = "a.csv"\n' if random.uniform() < 0.7 else str(random.choice(['file = "b.csv"\n', "file = 3\n"]))
    said = str(
        random.choice(
            ["", "", "", "rate_hz = 5", 'kind = "clutch"', "repair = 1", "odd = 2", 'rate_hz = "a"', "rest = true"]
        )
    )
    schema = "eaid/manifest/1" if random.uniform() < 0.95 else "eaid/manifest/2"
    logs = f"[[log]]\n{entry}{more}\n" if random.uniform() < 0.9 else ""
    (folder / "dataset.toml").write_text(f'schema = "{schema}"\n[options]\n{said}\n{logs}')

    def read() -> Any:
        manifest = manifest_of([folder])
        assert manifest is not None
        return [sorted(manifest.options), [[one.level, one.repeat, one.step_s] for one in manifest.logs]]

    return answered(read)


FAMILIES: dict[str, tuple[int, Callable[[Random, Path], Any]]] = {
    "texts": (240, of_texts), "several": (40, several), "mat": (50, of_mat), "hdf5": (50, of_hdf5), "lvm": (40, of_lvm),
    "frames": (120, of_frames), "moves": (60, of_moves), "names": (80, of_names), "manifests": (30, of_manifests),
}  # fmt: skip


def answers(family: str) -> list[Any]:
    """What is answered now to every log of a family."""
    count, ask = FAMILIES[family]
    outcomes = []
    for k in range(count):
        with tempfile.TemporaryDirectory() as folder:
            outcomes.append(plain(ask(np.random.default_rng([k, count]), Path(folder))))
    return outcomes


if __name__ == "__main__":
    rows = [
        f"{json.dumps(name)}: [\n" + ",\n".join(json.dumps(one, ensure_ascii=False) for one in answers(name)) + "\n]"
        for name in FAMILIES
    ]
    FILE.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")
