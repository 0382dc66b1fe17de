#!/usr/bin/env python3
"""False alarms of `explain` on ordinary logs in which nothing is missing.

    python3 benches/nulls.py BINARY [--cases 100] [--seed 1] [--jobs 2]

Each case is a plant (motor, spring, tank, furnace), sampled with its input held, in open or PI closed loop, about an operating
point; noise is slow and white together, an autoregressive moving average, near 1/f, heavy-tailed, or enters the state. The
simulation is the noise-free plant on the recorded input, in six digits. Standard library only.
"""
import argparse, concurrent.futures as futures, json, math, os, random, subprocess, tempfile


def held(a, b, h):
    """Discrete equivalent of x' = a x + b u for 1 or 2 states, by the series of the exponential."""
    n = len(a); m = n + 1
    big = [[a[i][j] * h for j in range(n)] + [b[i] * h] for i in range(n)] + [[0.0] * m]
    total = [[float(i == j) for j in range(m)] for i in range(m)]; term = [row[:] for row in total]
    for k in range(1, 40):
        term = [[sum(term[i][l] * big[l][j] for l in range(m)) / k for j in range(m)] for i in range(m)]
        total = [[total[i][j] + term[i][j] for j in range(m)] for i in range(m)]
    return [row[:n] for row in total[:n]], [total[i][n] for i in range(n)]


def plant(r):
    kind = r.choice(["motor", "spring", "tank", "furnace"])
    if kind == "spring":
        f, d = r.uniform(.8, 3), r.uniform(.08, .5); w = 2 * math.pi * f
        return kind, [[0, 1], [-w * w, -2 * d * w]], [0, w * w * r.uniform(.5, 3)], r.uniform(.03, .08) / f, 0.0, 0.0
    tau = {"motor": r.uniform(.1, .5), "tank": r.uniform(60, 300), "furnace": r.uniform(300, 1500)}[kind]
    gain = {"motor": r.uniform(20, 120), "tank": r.uniform(.3, 2), "furnace": r.uniform(.05, .3)}[kind]
    level = {"motor": (0.0, 0.0), "tank": (r.uniform(30, 60), r.uniform(20, 60)), "furnace": (r.uniform(800, 2000), r.uniform(80, 400))}[kind]
    return kind, [[-1 / tau]], [gain / tau], tau / r.uniform(8, 30), *level


def noise(r, kind, n, size):
    e = [r.gauss(0, 1) for _ in range(n + 400)]
    if kind == "slow and white":
        pole, v, x = 1 - 10 ** r.uniform(-3, -1), [], 0.0
        for k in range(n + 400):
            x = pole * x + math.sqrt(1 - pole * pole) * r.gauss(0, 1); v.append(x + e[k] * r.uniform(.9, 1.1))
    elif kind == "arma":
        radius, angle, c = r.uniform(.5, .9), r.uniform(.1, 1.5), r.uniform(-.6, .6); a1, a2, v = 2 * radius * math.cos(angle), -radius * radius, [0.0, 0.0]
        for k in range(2, n + 400): v.append(a1 * v[-1] + a2 * v[-2] + e[k] + c * e[k - 1])
    elif kind == "1/f":
        rows = [[0.0, 1 - 4.0 ** -i] for i in range(1, 7)]; v = []
        for k in range(n + 400):
            for row in rows: row[0] = row[1] * row[0] + math.sqrt(1 - row[1] ** 2) * r.gauss(0, 1)
            v.append(sum(row[0] for row in rows))
    else:
        v = [x / math.sqrt(sum(r.gauss(0, 1) ** 2 for _ in range(4)) / 4) for x in e] if kind == "heavy tails" else e
    v = v[400:]; m = sum(v) / n; s = math.sqrt(sum((x - m) ** 2 for x in v) / n)
    return [size * (x - m) / s for x in v] if kind != "state" else v


def record(seed, folder):
    r = random.Random(seed); n = r.choice([1800, 2400, 3600]); kind, a, b, h, u0, y0 = plant(r)
    ad, bd = held(a, b, h); states = len(a); gain = b[-1] / (-a[0][0] if states == 1 else -a[1][0])
    span = {"motor": 6.0, "spring": 2.0, "tank": 15.0, "furnace": 500.0}[kind]; size = abs(gain) * span * .5
    colour = r.choice(["slow and white", "slow and white", "slow and white", "arma", "1/f", "heavy tails", "state"]); share = r.uniform(.02, .08)
    v = noise(r, colour, n, share * size); loop = kind in ("motor", "tank") and r.random() < .4
    x, xs, ur, yr, ys, integral, want, hold = [0.0] * states, [0.0] * states, [], [], [], 0.0, 0.0, 0
    step = lambda x, u, w: [sum(ad[i][j] * x[j] for j in range(states)) + bd[i] * u + w * (i == states - 1) for i in range(states)]
    for k in range(n):
        if hold == 0: want, hold = r.uniform(-1, 1), r.randint(5, 60)
        hold -= 1; clean = x[0]; y = clean + (v[k] if colour != "state" else .3 * share * size * r.gauss(0, 1))
        if loop:
            error = want * size * 2 - y; integral += error * h; tau = -1 / a[0][0]; u = (.8 * error + integral / tau) / gain
        else: u = want * span
        ur.append(u0 + u); yr.append(y0 + y); ys.append(y0 + xs[0]); u = float("%.6g" % (u0 + u)) - u0
        x = step(x, u, share * size * .3 * v[k] * (bd[-1] / gain if states == 1 else 1.0 / h) * (states == 1) if colour == "state" else 0.0); xs = step(xs, u, 0.0)
    with open(os.path.join(folder, "r.csv"), "w") as f:
        f.write("t,u,y\n" + "".join("%.6g,%.6g,%.6g\n" % (k * h, ur[k], yr[k]) for k in range(n)))
    with open(os.path.join(folder, "s.csv"), "w") as f:
        f.write("t,y\n" + "".join("%.6g,%.6g\n" % (k * h, ys[k]) for k in range(n)))
    return f"{kind}{', loop' if loop else ''}, {colour}, noise {100 * share:.0f} %"


def case(binary, seed):
    with tempfile.TemporaryDirectory() as folder:
        said = record(seed, folder); out = os.path.join(folder, "e.json"); path = lambda name: os.path.join(folder, name)
        p = subprocess.run([binary, "explain", path("r.csv"), "--simulation", path("s.csv"), "--output", out], capture_output=True, text=True)
        if not os.path.exists(out): return seed, said, "error: " + p.stderr.strip()[-200:]
        e = json.load(open(out)); return seed, said, e["verdict"] + " " + ",".join(x["effect"] for x in e["effects"])


def main():
    ap = argparse.ArgumentParser(); ap.add_argument("binary"); ap.add_argument("--cases", type=int, default=100); ap.add_argument("--seed", type=int, default=1); ap.add_argument("--jobs", type=int, default=2); a = ap.parse_args()
    with futures.ThreadPoolExecutor(a.jobs) as pool: rows = list(pool.map(lambda k: case(os.path.abspath(a.binary), a.seed * 100000 + k), range(a.cases)))
    count = {}
    for seed, said, verdict in rows:
        word = verdict.split()[0]; count[word] = count.get(word, 0) + 1
        if word != "consistent": print(seed, said, "->", verdict)
    print(", ".join(f"{k} {v}" for k, v in sorted(count.items())), f"of {a.cases}")


if __name__ == "__main__":
    main()
