#!/usr/bin/env python3
"""The obvious alternative to the estimators: air-gap power, windows and force in straight numpy.

numpy_reference.py RECORDING.csv [JSON]: reads a recording (Interfaces, section 1; line-to-neutral
voltages, three currents), computes the papers' estimate in windows of 50 ms over whole arrays, and
prints rows a second of reading and of computing, and the mean force of the second quarter, so that
it can be seen that the work was done. Constants are those of the default machine.
"""
import json
import sys
import time

import numpy as np

RESISTANCE_OHM = 0.25  # star-equivalent
INERTIA_KG_M2 = 0.12
COULOMB_NM = 2.0
VISCOUS_NM_S = 0.008
LOAD_FRICTION = 0.06
LOAD_FRICTION_1_NM = 0.0015
RADIUS_M = 0.025
WINDOW_S = 0.05


def read(path):
    with open(path, encoding="utf-8") as file:
        rows_before = 0
        for line in file:
            rows_before += 1
            if not line.startswith("#"):
                names = line.strip().split(",")
                break
    data = np.loadtxt(path, delimiter=",", skiprows=rows_before, dtype=np.float64)
    return {name: np.ascontiguousarray(data[:, k]) for k, name in enumerate(names)}


def force(columns):
    """Cutting force at the end of every window, N."""
    t = columns["t_s"]
    n = int(round(WINDOW_S / (t[1] - t[0])))
    v = [columns[name].astype(np.float32) for name in ("v_un_v", "v_vn_v", "v_wn_v")]
    i = [columns[name].astype(np.float32) for name in ("i_u_a", "i_v_a", "i_w_a")]
    power = v[0] * i[0] + v[1] * i[1] + v[2] * i[2]
    copper = RESISTANCE_OHM * (i[0] * i[0] + i[1] * i[1] + i[2] * i[2])
    airgap = power - copper
    windows = len(airgap) // n
    mean = airgap[: windows * n].reshape(windows, n).mean(axis=1)
    speed = columns["speed_rad_s"][n - 1 : windows * n : n]
    torque = mean / np.maximum(speed, 1.0)
    acceleration = np.diff(speed, prepend=speed[0]) / WINDOW_S
    load = torque - INERTIA_KG_M2 * acceleration - COULOMB_NM - VISCOUS_NM_S * speed
    one_plus = 1.0 + LOAD_FRICTION
    root = np.sqrt(one_plus * one_plus + 4.0 * LOAD_FRICTION_1_NM * np.abs(load))
    return 2.0 * load / (one_plus + root) / RADIUS_M


def force_sample_by_sample(columns, rows):
    """The same, one row after another, as a closed loop needs it: nothing is known of the future."""
    t = columns["t_s"]
    n = int(round(WINDOW_S / (t[1] - t[0])))
    names = ("v_un_v", "v_vn_v", "v_wn_v", "i_u_a", "i_v_a", "i_w_a", "speed_rad_s")
    cells = np.stack([columns[name][:rows] for name in names], axis=1).tolist()
    total, before, newton = 0.0, cells[0][6], []
    for k, (vu, vv, vw, iu, iv, iw, speed) in enumerate(cells, start=1):
        total += vu * iu + vv * iv + vw * iw - RESISTANCE_OHM * (iu * iu + iv * iv + iw * iw)
        if k % n == 0:
            torque = total / n / max(speed, 1.0) - INERTIA_KG_M2 * (speed - before) / WINDOW_S
            load = torque - COULOMB_NM - VISCOUS_NM_S * speed
            one_plus = 1.0 + LOAD_FRICTION
            root = (one_plus * one_plus + 4.0 * LOAD_FRICTION_1_NM * abs(load)) ** 0.5
            newton.append(2.0 * load / (one_plus + root) / RADIUS_M)
            total, before = 0.0, speed
    return newton


def best_of(times, function, *arguments):
    best = float("inf")
    for _ in range(times):
        began = time.perf_counter()
        result = function(*arguments)
        best = min(best, time.perf_counter() - began)
    return best, result


def main():
    path = sys.argv[1]
    read_s, columns = best_of(2, read, path)
    compute_s, newton = best_of(10, force, columns)
    rows = len(columns["t_s"])
    some = min(rows, 100_000)
    stepped_s, stepped = best_of(3, force_sample_by_sample, columns, some)
    if not np.allclose(stepped, newton[: len(stepped)], rtol=1e-3, atol=0.5):
        sys.exit("the two ways of computing disagree")
    figures = {
        "rows": rows,
        "read_rows_per_s": rows / read_s,
        "compute_rows_per_s": rows / compute_s,
        "read_and_compute_rows_per_s": rows / (read_s + compute_s),
        "step_rows_per_s": some / stepped_s,
        "mean_force_n": float(newton[len(newton) // 4 : len(newton) // 2].mean()),
        "numpy": np.__version__,
    }
    text = json.dumps(figures, indent=2)
    if len(sys.argv) > 2:
        with open(sys.argv[2], "w", encoding="utf-8") as out:
            out.write(text + "\n")
    else:
        print(text)


if __name__ == "__main__":
    main()
