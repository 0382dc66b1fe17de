#!/usr/bin/env python3
"""What `explain` answers when the effect that is missing is taken out of its library. Standard library only.

    python3 benches/leave_one_out.py BINARY CASES [--jobs 2]

CASES holds case_NNN/{recording.csv, simulation.csv | simulation.json} and truth/case_NNN.json with the list `effects`, as
`cargo run --release --example conceal` writes them. Each case is explained with `--without` for each of its effects. The right
answer is `unexplained`. A name that leaves residuals from which no test can tell noise (p > 0.001) cannot be refused by data.
"""

import argparse
import collections
import concurrent.futures
import json
import os
import subprocess
import sys
import tempfile


def explain(binary, folder, case):
    truth = json.load(open(os.path.join(folder, "truth", case + ".json")))["effects"]
    if not truth or any(t.startswith("x_") for t in truth):
        return None
    path = os.path.join(folder, case)
    simulation = os.path.join(path, "simulation.json")
    if not os.path.exists(simulation):
        simulation = os.path.join(path, "simulation.csv")
    with tempfile.TemporaryDirectory() as scratch:
        output = os.path.join(scratch, "explanation.json")
        command = [binary, "explain", os.path.join(path, "recording.csv"), "--simulation", simulation]
        for effect in truth:
            command += ["--without", effect]
        run = subprocess.run(command + ["--output", output], capture_output=True, text=True)
        if run.returncode:
            return case, truth, "error", [run.stderr.strip()[-200:]], None
        answer = json.load(open(output))
    named = [effect["effect"] for effect in answer.get("effects", [])]
    return case, truth, answer["verdict"], named, (answer.get("remaining") or {}).get("p_value")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("cases")
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    cases = sorted(c for c in os.listdir(arguments.cases) if c.startswith("case_"))
    binary = os.path.abspath(arguments.binary)
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        rows = [r for r in pool.map(lambda c: explain(binary, arguments.cases, c), cases) if r]
    for case, truth, verdict, named, p_value in rows:
        print(f"{case} {','.join(truth):30} {verdict:12} {','.join(named):30} {'' if p_value is None else f'p = {p_value:.2g}'}")
    print(len(rows), "cases:", dict(collections.Counter(row[2] for row in rows)))


if __name__ == "__main__":
    sys.exit(main())
