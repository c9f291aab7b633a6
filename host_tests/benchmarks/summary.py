#!/usr/bin/env python3
"""Figures and ratios of one run of toolchain/benchmark.sh.

summary.py BENCHMARKS.json NUMPY.json [INSTRUCTIONS.txt]: Google Benchmark's output, that of
numpy_reference.py, and that of toolchain/count_instructions.sh. Times are means of one run.
"""
import json
import sys


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        runs = {run["name"]: run for run in json.load(file)["benchmarks"]}
    with open(sys.argv[2], encoding="utf-8") as file:
        numpy = json.load(file)
    counted = {}
    if len(sys.argv) > 3:
        with open(sys.argv[3], encoding="utf-8") as file:
            for line in file:
                if not line.startswith("#"):
                    name, count = line.split()
                    counted[name] = float(count)

    nanoseconds = {name: run["cpu_time"] for name, run in runs.items() if run["time_unit"] == "ns"}

    def block(title, ours, per=1, less=()):
        """A body, per so many calls, less so many times other bodies."""

        def of(table):
            if ours not in table:
                return None
            return (table[ours] - sum(n * table[other] for other, n in less)) / per

        time, count = of(nanoseconds), of(counted)
        count_text = f"{count:14.0f}" if count is not None else " " * 14
        print(f"  {title:<48}{time:10.1f}{count_text}")

    source = ("endless_cut_itself", 1)
    print(f"{'One core, 5 kHz raw samples, 1 ms ticks':<50}{'ns':>10}{'instructions':>14}")
    block("raw sample: gate, front end, health, flux torque", "raw_sample_path", 1, (source,))
    block("raw sample of the fused observer, front end", "fused_observer_sample", 1, (source,))
    block("tick of the fused observer", "fused_observer_millisecond", 1,
          (("fused_observer_sample", 5),))
    block("raw sample of the papers' path, its window in it", "torque_path_window_of_250", 250,
          (source,) * 250)
    block("control tick", "control_tick")
    block("whole loop, fused, a raw sample", "control_loop_fused_50_ms", 250, (source,) * 250)
    block("whole loop, synthesized, a raw sample", "control_loop_synthesized_50_ms", 250,
          (source,) * 250)

    def rate(name):
        return runs[name]["items_per_second"]

    print(f"\n{'One core, 400 000 rows of nine columns at 20 kHz':<50}{'rows/s':>10}{'ratio':>9}")

    def row(title, rows_per_s, alternative=None, what=""):
        ratio = f"{rows_per_s / alternative:8.1f}x {what}" if alternative else ""
        print(f"  {title:<46}{rows_per_s / 1e6:9.2f}e6 {ratio}")

    row("read CSV text", rate("read_recording/csv"), numpy["read_rows_per_s"], "numpy.loadtxt")
    row("", rate("read_recording/csv"), rate("read_with_getline"), "getline, strtof")
    row("read binary", rate("read_recording/binary"))
    for estimator in ("fused", "synthesized"):
        row(f"replay CSV text, {estimator}", rate(f"replay/csv_{estimator}"),
            numpy["read_and_compute_rows_per_s"], "numpy, reading and whole arrays")
        row(f"replay binary, {estimator}", rate(f"replay/binary_{estimator}"))
        row(f"the loop alone, {estimator}", rate(f"loop_in_memory/{estimator}"),
            numpy["step_rows_per_s"], "Python, sample by sample")
        row("", rate(f"loop_in_memory/{estimator}"), numpy["compute_rows_per_s"],
            "numpy, whole arrays")
    print("\n  numpy computes the papers' power, windows and force and nothing else: no gate, no")
    print("  health, no tare, no uncertainty, no override. Whole arrays cannot close a loop.")

    print(f"\n{'Simulated machine, times real time':<50}")
    for name in ("averaged_lathe", "averaged_lathe_with_noise", "averaged_motor_a",
                 "switched_motor_a"):
        print(f"  {name:<46}{runs[name]['times_real_time']:12.0f}")


if __name__ == "__main__":
    main()
