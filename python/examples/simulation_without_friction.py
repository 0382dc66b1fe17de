"""A simulation that misses friction: innovant says so, and gives the simulation with friction in it.

Run: python simulation_without_friction.py [page.html]
"""

import sys

import numpy as np

import innovant

DT = 0.01


def positioning_stage(u, friction):
    """Position of a mass of 1 kg on a spring (25 N/m) with viscous (1 Ns/m) and dry friction (N)."""
    position, velocity, y = 0.0, 0.0, np.empty(len(u))
    for k, force in enumerate(u):
        y[k] = position
        for _ in range(20):
            acceleration = force - 25.0 * position - velocity - friction * np.tanh(velocity / 1e-3)
            velocity += acceleration * DT / 20
            position += velocity * DT / 20
    return y


def simulator(u):
    """What the engineer believes: no dry friction."""
    return positioning_stage(u, friction=0.0)


def main():
    rng = np.random.default_rng(1)
    u = np.repeat(rng.normal(0.0, 2.0, 150), 10)
    y = positioning_stage(u, friction=0.3) + rng.normal(0.0, 2e-4, len(u))
    found = innovant.explain(
        u, y, simulation=simulator, dt=DT, inputs="force [N]", outputs="position [m]"
    )
    print(found)
    # New inputs, never seen.
    u = np.repeat(rng.normal(0.0, 2.0, 60), 10)
    truth = positioning_stage(u, friction=0.3)
    before = np.sqrt(np.mean((simulator(u) - truth) ** 2))
    after = np.sqrt(np.mean((found.simulate(u) - truth) ** 2))
    print(f"error on new inputs: {1e3 * before:.2f} mm before, {1e3 * after:.2f} mm after")
    if len(sys.argv) > 1:
        found.report(sys.argv[1])
    return found, before, after


if __name__ == "__main__":
    main()
