"""A simulator of your own, calibrated from a recording: as a function in Python, and as a program on the command line.

Run: python external_simulator.py [FOLDER]

With a folder it also writes log.csv and parameters.json there, and says what to type. On the command line innovant runs
this file as the simulator: python external_simulator.py INPUT OUTPUT PARAMETERS
"""

import csv
import json
import math
import sys
from pathlib import Path

DT = 1.0  # s
PARAMETERS = {
    "k": {"value": 0.04, "min": 0.01, "max": 0.2, "unit": "m/s", "description": "flow of the pump"},
    "a": {"value": 0.08, "min": 0.01, "max": 0.5, "unit": "m(1/2)/s", "description": "opening of the outlet"},
    "h0": {"value": 1.5, "min": 0.0, "max": 5.0, "unit": "m", "description": "level at the start"},
}


def simulate(u, k, a, h0):
    """Level of a tank: h' = k u - a sqrt(h), u held over each sample."""
    h, levels = h0, []
    for flow in u:
        levels.append(h)
        for _ in range(10):
            slope = k * flow - a * math.sqrt(max(h, 0.0))
            middle = k * flow - a * math.sqrt(max(h + 0.05 * DT * slope, 0.0))
            h += 0.1 * DT * middle
    return levels


def run_files(inputs, outputs, parameters):
    """The same with files: a column u in, a column y out, and the parameters by name."""
    with open(inputs, newline="") as file:
        rows = list(csv.DictReader(file))
    with open(parameters) as file:
        values = json.load(file)
    levels = simulate([float(row["u"]) for row in rows], **values)
    with open(outputs, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", "y"])
        writer.writerows(zip([row["t"] for row in rows], levels))


def record(samples=1000, seed=5):
    """A recording of a tank whose parameters are others than those of PARAMETERS."""
    import numpy as np

    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(1.0, 4.0, samples // 25), 25)
    y = np.array(simulate(u, k=0.05, a=0.1, h0=1.3)) + 0.01 * rng.standard_normal(samples)
    return u, y


def main():
    import innovant

    u, y = record()
    bounds = {name: (p["value"], p["min"], p["max"]) for name, p in PARAMETERS.items()}
    fitted = innovant.Simulator(simulate, parameters=bounds).fit(u, y, dt=DT)
    print(fitted)
    if len(sys.argv) > 1:
        folder = Path(sys.argv[1])
        with open(folder / "log.csv", "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["t", "u", "y"])
            writer.writerows((k * DT, float(a), float(b)) for k, (a, b) in enumerate(zip(u, y)))
        (folder / "parameters.json").write_text(json.dumps(PARAMETERS, indent=2) + "\n")
        print("the same on the command line:")
        print(
            f"  innovant identify {folder / 'log.csv'} --simulator 'python3 {__file__} {{input}} {{output}} {{parameters}}'"
            f" --simulator-parameters {folder / 'parameters.json'}"
        )
    return fitted


if __name__ == "__main__":
    if len(sys.argv) == 4:
        run_files(*sys.argv[1:])
    else:
        main()
