"""What the tests share."""

from types import SimpleNamespace

import numpy as np
import pytest

import innovant


@pytest.fixture(scope="session")
def closed_loop():
    """Two inputs, two outputs, order 4, under feedback."""
    u, y, dt = innovant.examples.closed_loop(2000, seed=1)
    u.flags.writeable = y.flags.writeable = False
    return SimpleNamespace(u=u, y=y, dt=dt)


@pytest.fixture(scope="session")
def model(closed_loop):
    """The model of it."""
    return innovant.identify(closed_loop.u, closed_loop.y, dt=closed_loop.dt)


def mass(u, friction, dt=0.01, stiffness=25.0, steps=20):
    """Position of a mass on a spring with viscous and dry friction, integrated at fine steps."""
    position, velocity, y = 0.0, 0.0, np.empty(len(u))
    for k, force in enumerate(np.asarray(u, dtype=float).reshape(len(u), -1)[:, 0]):
        y[k] = position
        for _ in range(steps):
            acceleration = force - stiffness * position - velocity - friction * np.tanh(velocity / 1e-3)
            velocity += acceleration * dt / steps
            position += velocity * dt / steps
    return y


@pytest.fixture(scope="session")
def friction():
    """A recording of a mass with dry friction, and a simulator that has none."""
    rng = np.random.default_rng(1)
    u = np.repeat(rng.normal(0.0, 2.0, 150), 10)
    y = mass(u, 0.3) + rng.normal(0.0, 2e-4, len(u))
    return SimpleNamespace(u=u, y=y, dt=0.01, simulate=lambda u: mass(u, 0.0), truth=lambda u: mass(u, 0.3))


@pytest.fixture(scope="session")
def explanation(friction):
    """What that simulator leaves out."""
    return innovant.explain(friction.u, friction.y, simulation=friction.simulate, dt=friction.dt)
