"""A servo under control, identified while the controller works: what is it, and how sure is that?

Run: python servo_in_closed_loop.py [page.html]
"""

import sys

import numpy as np

import innovant

DT = 0.002
RESONANCE = 2 * np.pi * 18.0  # rad/s
DAMPING = 0.05


def plant():
    """Discrete A, B, C of a motor with a flexible coupling, voltage to speed."""
    from scipy.linalg import expm

    a = np.array([[-6.0, 0.0, 0.0], [0.0, 0.0, 1.0], [RESONANCE**2, -(RESONANCE**2), -2 * DAMPING * RESONANCE]])
    b = np.array([[60.0], [0.0], [0.0]])
    joint = expm(np.block([[a, b], [np.zeros((1, 4))]]) * DT)
    return joint[:3, :3], joint[:3, 3:], np.array([[0.0, 1.0, 0.0]])


def record(samples=8000, seed=3):
    """Voltage and speed while a controller follows a reference that steps now and then."""
    rng = np.random.default_rng(seed)
    a, b, c = plant()
    x, u, y = np.zeros(3), np.empty(samples), np.empty(samples)
    reference = np.repeat(rng.normal(20.0, 8.0, samples // 100), 100)
    integral = 0.0
    for k in range(samples):
        y[k] = (c @ x)[0] + 0.05 * rng.standard_normal()
        error = reference[k] - y[k]
        integral += error * DT
        u[k] = 0.1 * error + 0.8 * integral + 0.2 * rng.standard_normal()
        x = a @ x + b[:, 0] * u[k]
    return u, y


def main():
    u, y = record()
    model = innovant.identify(u, y, dt=DT, inputs="voltage [V]", outputs="speed [rad/s]")
    print(model)
    poles = model.poles()
    resonant = np.flatnonzero(poles.values.imag > 0)[0]
    hertz, std = poles.natural_frequency[resonant] / (2 * np.pi), poles.natural_frequency_std[resonant] / (2 * np.pi)
    print(f"resonance at {hertz:.2f} +- {std:.2f} Hz; true is {RESONANCE / (2 * np.pi):.2f} Hz")
    fresh = model.validate(*record(seed=4))
    print("a second recording:", "rejects the model" if fresh.rejected else "agrees with the model")
    if len(sys.argv) > 1:
        model.plot_bode().write_html(sys.argv[1])
    return model, hertz, std, fresh


if __name__ == "__main__":
    main()
