"""The reference plant as fit.json, published gains as gains.json, and a replay.h5 read again."""

from eaid.replay import files

FIT = {
    "schema": "eaid/fit/1",
    "nonlinear": {
        "C": 0.85,
        "tau1": [6.74e-3, 2.39e-2, -2.13e-4],
        "tau2": [0.93, 0.41, -2.64e-3],
        "Ts": [0.032, 9.2e-3, 2.1e-4, 1.32e-6],
        "u_range": [10, 100],
    },
}
GAINS = {
    "schema": "eaid/gains/1",
    "model": {"a0": 1.36, "b0": 0.08, "c0": -2.42},
    "rc": {
        "K_P": 4.5, "K_D": 3, "B_hat": 12.5, "rho": {"constant": 10.8125, "slope": 6.58595}, "Q_M": 5.0,
        "epsilon": 0.5, "gamma": 50, "Q": [[1, 5 / 9], [5 / 9, (5 + 10 / 9) / 6]],
    },
    "pi": {"K_P": 21.0, "K_I": 360.0},
}  # fmt: skip


def read_replay(path):
    """Groups by name, and what the file says of itself."""
    found, _ = files.read(path)
    return found.records, found.head
