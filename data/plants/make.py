#!/usr/bin/env python3
"""Makes the recordings of the plants in this folder.

    python3 make.py [FOLDER]        writes NAME.csv into FOLDER [default: where this file is]

Each plant is integrated with the classical Runge-Kutta method at a step far below the sample time. The right-hand sides
are written here once more, in Python: nothing is shared with innovant. The equations are those of NAME.mo, the parameters
are others (`TRUE`), and the states do not start where the text says. Seeds are fixed, so that the files are the same on
every run. Only the standard library is needed.
"""

import math
import random
import sys
from pathlib import Path

G_N, SIGMA = 9.80665, 5.67037441918443e-8

TRUE = {
    "pendulum": dict(m=0.42, J=0.0065, d=0.032, k=0.155, l=0.3),
    "tanks": dict(A1=0.0154, A2=0.0154, a1=4.3e-5, a2=5.7e-5, kp=2.35e-5),
    "motor": dict(R=1.15, L=0.0021, k=0.051, J=2.1e-4, d=4.5e-5, Tc=0.031),
    "heated_mass": dict(Ch=42.0, Cb=430.0, G=2.1, hA=0.31, eps=0.78, A=0.03),
    "quarter_car": dict(ms=310.0, mu=38.0, ks=1.65e4, k3=2.4e6, c=1250.0, kt=1.75e5),
}


def runge_kutta(f, x, t, h):
    """One step of the classical method for x' = f(t, x)."""
    a = f(t, x)
    b = f(t + h / 2, [p + h / 2 * q for p, q in zip(x, a)])
    c = f(t + h / 2, [p + h / 2 * q for p, q in zip(x, b)])
    d = f(t + h, [p + h * q for p, q in zip(x, c)])
    return [p + h / 6 * (q + 2 * r + 2 * s + u) for p, q, r, s, u in zip(x, a, b, c, d)]


def steps(rng, count, shortest, longest, levels):
    """A signal that is held for a random number of samples at a random level: `levels` draws one."""
    signal = []
    while len(signal) < count:
        signal += [levels()] * rng.randint(shortest, longest)
    return signal[:count]


def slow(rng, count, pole, std):
    """Slow noise: autoregressive of first order."""
    value, series = rng.gauss(0, std), []
    for _ in range(count):
        series.append(value)
        value = pole * value + std * math.sqrt(1 - pole * pole) * rng.gauss(0, 1)
    return series


def pendulum(p):
    """Torque in steps, swings up to 2.4 rad; white noise of 10 mrad."""
    rng, dt, count, fine = random.Random(1), 0.01, 2500, 10
    u = [round(v, 3) for v in steps(rng, count, 15, 60, lambda: rng.uniform(-5.5, 5.5))]
    x, rows = [0.31, -0.8], []

    def f(volts):
        inertia, weight = p["J"] + p["m"] * p["l"] ** 2, p["m"] * G_N * p["l"]
        return lambda t, x: [x[1], (p["k"] * volts - p["d"] * x[1] - weight * math.sin(x[0])) / inertia]

    for n in range(count):
        rows.append((n * dt, u[n], x[0] + rng.gauss(0, 0.01)))
        for _ in range(fine):
            x = runge_kutta(f(u[n]), x, 0, dt / fine)
    return ["t [s]", "u [V]", "y [rad]"], rows


def tanks(p):
    """Pump voltage in steps, levels from a few centimetres to half a metre; white noise of 2 mm."""
    rng, dt, count, fine = random.Random(2), 4.0, 2500, 20
    u = [round(v, 3) for v in steps(rng, count, 30, 120, lambda: rng.uniform(0.5, 6.0))]
    x, rows = [0.12, 0.31], []

    def f(volts):
        out = lambda a, h: a * math.sqrt(2 * G_N * max(h, 0))
        return lambda t, x: [
            (p["kp"] * volts - out(p["a1"], x[0])) / p["A1"],
            (out(p["a1"], x[0]) - out(p["a2"], x[1])) / p["A2"],
        ]

    for n in range(count):
        rows.append((n * dt, u[n], x[0] + rng.gauss(0, 0.002), x[1] + rng.gauss(0, 0.002)))
        for _ in range(fine):
            x = runge_kutta(f(u[n]), x, 0, dt / fine)
    return ["t [s]", "u [V]", "y1 [m]", "y2 [m]"], rows


def motor(p):
    """Under a PI controller that reads the noisy speed; the reference reverses, and the shaft sticks at zero speed.

    While it sticks the speed is zero exactly, until the torque of the motor exceeds the dry friction. A step in which the
    speed changes its sign ends at zero speed. White noise of 30 mA and 0.5 rad/s.
    """
    rng, dt, count, fine = random.Random(3), 0.001, 3000, 100
    reference = steps(rng, count, 60, 200, lambda: rng.choice([-1, -1, 0, 1, 1]) * rng.uniform(10, 120))
    i, w, integral, h, rows = 0.4, 22.0, 1.0, dt / fine, []

    def f(volts, sense):
        electric = lambda x: (volts - p["R"] * x[0] - p["k"] * x[1]) / p["L"]
        if sense == 0:
            return lambda t, x: [electric(x), 0.0]
        return lambda t, x: [electric(x), (p["k"] * x[0] - p["d"] * x[1] - p["Tc"] * sense) / p["J"]]

    for n in range(count):
        speed = w + rng.gauss(0, 0.5)
        error = reference[n] - speed
        integral = max(-12.0, min(12.0, integral + 1.5 * error * dt))
        u = round(max(-12.0, min(12.0, 0.06 * error + integral)), 4)
        rows.append((n * dt, u, i + rng.gauss(0, 0.03), speed))
        for _ in range(fine):
            if w != 0:
                sense = math.copysign(1, w)
            else:
                sense = 0 if abs(p["k"] * i) <= p["Tc"] else math.copysign(1, i)
            i, after = runge_kutta(f(u, sense), [i, w], 0, h)
            w = 0.0 if w * after < 0 else after
    return ["t [s]", "u [V]", "y1 [A]", "y2 [rad/s]"], rows


def heated_mass(p):
    """Power in steps, up to 600 K; slow noise of 0.4 K (200 s) and white noise of 0.1 K."""
    rng, dt, count, fine = random.Random(4), 5.0, 2400, 10
    power = [round(v, 1) for v in steps(rng, count, 20, 120, lambda: rng.choice([0, rng.uniform(20, 280)]))]
    air = [round(294 + 2 * math.sin(n * dt / 4000), 2) for n in range(count)]
    noise = slow(rng, count, math.exp(-dt / 200), 0.4)
    x, rows = [331.0, 327.0], []

    def f(watts, around):
        def slope(t, x):
            flow = p["G"] * (x[0] - x[1])
            loss = p["hA"] * (x[1] - around) + p["eps"] * p["A"] * SIGMA * (x[1] ** 4 - around**4)
            return [(watts - flow) / p["Ch"], (flow - loss) / p["Cb"]]

        return slope

    for n in range(count):
        rows.append((n * dt, power[n], air[n], x[1] + noise[n] + rng.gauss(0, 0.1)))
        for _ in range(fine):
            x = runge_kutta(f(power[n], air[n]), x, 0, dt / fine)
    return ["t [s]", "P [W]", "Ta [K]", "T [K]"], rows


def quarter_car(p):
    """On a post that moves on straight lines between the samples, up to 8 cm; white noise of 0.15 m/s2."""
    rng, dt, count, fine = random.Random(5), 0.005, 2800, 20
    rough = slow(rng, count + 1, 0.97, 0.012)
    waves = [sum(a * math.sin(2 * math.pi * f * n * dt) for a, f in ((0.035, 1.1), (0.02, 1.7))) for n in range(count + 1)]
    post = [round(a + b, 5) for a, b in zip(rough, waves)]
    x, rows = [0.01, -0.05, 0.004, 0.1], []

    def f(start, slope):
        def derivative(t, x):
            (zs, vs, zu, vu), zr = x, start + slope * t
            force = p["ks"] * (zu - zs) + p["k3"] * (zu - zs) ** 3 + p["c"] * (vu - vs)
            return [vs, force / p["ms"], vu, (p["kt"] * (zr - zu) - force) / p["mu"]]

        return derivative

    for n in range(count):
        g = f(post[n], (post[n + 1] - post[n]) / dt)
        rows.append((n * dt, post[n], g(0, x)[1] + rng.gauss(0, 0.15)))
        for k in range(fine):
            x = runge_kutta(g, x, k * dt / fine, dt / fine)
    return ["t [s]", "zr [m]", "acc [m/s2]"], rows


def main():
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for make in (pendulum, tanks, motor, heated_mass, quarter_car):
        names, rows = make(TRUE[make.__name__])
        lines = [",".join(names)] + [",".join(f"{v:.6g}" for v in row) for row in rows]
        (folder / f"{make.__name__}.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
