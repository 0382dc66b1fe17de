#!/usr/bin/env python3
"""How often `explain` is right when it states a probability. Standard library only.

    python3 benches/reliability.py BINARY [CASES ...] [--nulls SEED:COUNT,..] [--jobs 2] [--fit]

CASES are folders as `cargo run --release --example conceal` writes them: case_NNN/{recording.csv, simulation.csv |
simulation.json} and truth/case_NNN.json with the list `effects`. `--nulls` adds ordinary logs of nulls.py, in which nothing is
missing. Printed are what was stated and what was right, by stated probability and by verdict. Right are all effects and no
other by their names or by near relatives, a tie among which all effects are, `consistent` and `parameters` where nothing is
missing, and `unexplained` where the effect is in no library.

`--fit` prints the constants of src/explain/linear/answer/probability.rs as these cases give them. Where constants were fitted, the table of
the same cases says nothing: draw others.
"""
import argparse, concurrent.futures as futures, json, math, os, subprocess, sys, tempfile

import nulls

RELATIVES = [{"coulomb_friction", "stribeck_friction"}]
# Effects of the simulator that entered the library under another name.
LISTED = {"x_cogging": "cogging"}
TIE = 6.0
NEEDED = 11.4
LEVEL = 1e-4
RIDGE = 1.0
QUIET = ("consistent", "parameters")


def alike(a, b):
    return a == b or any(a in group and b in group for group in RELATIVES)


def right(truth, e):
    verdict, named = e["verdict"], [x["effect"] for x in e["effects"]]
    if not truth or verdict in QUIET: return not truth and verdict in QUIET
    listed = [LISTED.get(t, t) for t in truth]
    if verdict == "unexplained": return all(t.startswith("x_") for t in truth)
    if any(t.startswith("x_") for t in listed): return False
    if all(any(alike(t, n) for n in named) for t in listed) and all(any(alike(t, n) for t in listed) for n in named): return True
    best = e["effects"][0]["evidence"]["criterion_gain"]
    tied = named + [a["effect"] for a in e["alternatives"] if best - a["criterion_gain"] < TIE]
    return verdict == "family" and all(t in tied for t in listed)


def explain(binary, recording, simulation):
    with tempfile.TemporaryDirectory() as scratch:
        output = os.path.join(scratch, "e.json")
        run = subprocess.run([binary, "explain", recording, "--simulation", simulation, "--output", output], capture_output=True, text=True)
        if run.returncode or not os.path.exists(output):
            print("error:", recording, run.stderr.strip()[-200:], file=sys.stderr)
            return None
        return json.load(open(output))


def features(e):
    """The figures of probability.rs; None where the share alone is stated."""
    rivals = [a["criterion_gain"] for a in e["alternatives"]]
    if e["verdict"] in QUIET:
        left = 1 - e["fit"]["train"]["augmented"]["fit_percent"] / 100
        short = NEEDED - (rivals[0] if rivals else -10.0)
        return "quiet", [min(short, 20.0), math.log(min(max(left, .01), .1)), float(e["verdict"] == "parameters")]
    gain = e["effects"][0]["evidence"]["criterion_gain"] if e["effects"] else 0.0
    if e["verdict"] == "named" and gain > 0:
        lead = gain - max(rivals[0] if rivals else 0.0, 0.0)
        return "named", [math.log(max(lead, .1)), math.log(max(e["remaining"]["p_value"], LEVEL))]
    return e["verdict"] + (" from the samples alone" if e["verdict"] == "named" else ""), None


def summarised(truth, e, label):
    kind, figures = features(e)
    return dict(label=label, truth=truth, verdict=e["verdict"], named=[x["effect"] for x in e["effects"]], stated=e["probability"], right=right(truth, e), kind=kind, figures=figures)


def concealed(binary, folder, case):
    truth = json.load(open(os.path.join(folder, "truth", case + ".json")))["effects"]; path = os.path.join(folder, case)
    simulation = os.path.join(path, "simulation.json")
    if not os.path.exists(simulation): simulation = os.path.join(path, "simulation.csv")
    e = explain(binary, os.path.join(path, "recording.csv"), simulation)
    return e and summarised(truth, e, os.path.join(os.path.basename(folder.rstrip("/")), case))


def ordinary(binary, seed):
    with tempfile.TemporaryDirectory() as folder:
        nulls.record(seed, folder); e = explain(binary, os.path.join(folder, "r.csv"), os.path.join(folder, "s.csv"))
    return e and summarised([], e, f"nulls {seed}")


def solve(a, b):
    """Gauss elimination with pivots."""
    n = len(b); rows = [a[i][:] + [b[i]] for i in range(n)]
    for i in range(n):
        pivot = max(range(i, n), key=lambda r: abs(rows[r][i])); rows[i], rows[pivot] = rows[pivot], rows[i]
        for r in range(i + 1, n):
            f = rows[r][i] / rows[i][i]; rows[r] = [x - f * y for x, y in zip(rows[r], rows[i])]
    x = [0.0] * n
    for i in reversed(range(n)): x[i] = (rows[i][n] - sum(rows[i][j] * x[j] for j in range(i + 1, n))) / rows[i][i]
    return x


def logistic(xs, ys):
    """Offset and slopes, with a weak ridge on slopes of figures of variance one."""
    n, m = len(xs), len(xs[0]); mean = [sum(x[j] for x in xs) / n for j in range(m)]
    size = [math.sqrt(sum((x[j] - mean[j]) ** 2 for x in xs) / n) or 1.0 for j in range(m)]
    z = [[1.0] + [(x[j] - mean[j]) / size[j] for j in range(m)] for x in xs]; w = [0.0] * (m + 1); ridge = [1e-3] + [RIDGE] * m
    for _ in range(50):
        p = [1 / (1 + math.exp(-sum(a * b for a, b in zip(w, row)))) for row in z]
        slope = [sum((q - y) * row[i] for q, y, row in zip(p, ys, z)) + ridge[i] * w[i] for i in range(m + 1)]
        curve = [[sum(q * (1 - q) * row[i] * row[j] for q, row in zip(p, z)) + ridge[i] * (i == j) for j in range(m + 1)] for i in range(m + 1)]
        w = [a - b for a, b in zip(w, solve(curve, slope))]
    slopes = [a / s for a, s in zip(w[1:], size)]
    return w[0] - sum(s * a for s, a in zip(slopes, mean)), slopes


def line(name, group):
    if group: print(f"{name:34} {len(group):5} {sum(r['stated'] for r in group) / len(group):9.3f} {sum(r['right'] for r in group):7} {sum(r['right'] for r in group) / len(group):9.3f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary"); parser.add_argument("cases", nargs="*"); parser.add_argument("--nulls", default="")
    parser.add_argument("--jobs", type=int, default=2); parser.add_argument("--fit", action="store_true"); a = parser.parse_args()
    binary = os.path.abspath(a.binary)
    tasks = [(concealed, binary, folder, case) for folder in a.cases for case in sorted(os.listdir(folder)) if case.startswith("case_")]
    for draw in filter(None, a.nulls.split(",")):
        seed, count = map(int, draw.split(":"))
        tasks += [(ordinary, binary, seed * 100000 + k) for k in range(count)]
    with futures.ThreadPoolExecutor(a.jobs) as pool: rows = [r for r in pool.map(lambda t: t[0](*t[1:]), tasks) if r]
    for r in rows:
        if not r["right"]: print(r["label"], ",".join(r["truth"]) or "nothing", "->", r["verdict"], ",".join(r["named"]), f"{r['stated']:.2f}")
    print(f"{'':34} {'cases':>5} {'stated':>9} {'right':>7} {'share':>9}")
    edges = [0.0, .5, .7, .8, .85, .95, .98, 1.01]
    for low, high in zip(edges, edges[1:]): line(f"stated {low} to {min(high, 1.0)}", [r for r in rows if low <= r["stated"] < high])
    for verdict in ("named", "family", *QUIET, "unexplained"): line(verdict, [r for r in rows if r["verdict"] == verdict])
    line("all", rows)
    if rows:
        loss = -sum(math.log(max(r["stated"] if r["right"] else 1 - r["stated"], 1e-9)) for r in rows) / len(rows)
        print(f"log loss {loss:.3f}")
    for kind in sorted({r["kind"] for r in rows}) if a.fit else []:
        group = [r for r in rows if r["kind"] == kind]
        if group[0]["figures"] is None: print(f"{kind}: {sum(r['right'] for r in group)} of {len(group)}"); continue
        offset, slopes = logistic([r["figures"] for r in group], [float(r["right"]) for r in group])
        print(f"{kind}: offset {offset:.2f}, slopes", ", ".join(f"{s:.3f}" for s in slopes))


if __name__ == "__main__":
    main()
