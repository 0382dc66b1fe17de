"""The wheel gives what the core gives."""

import json

import numpy as np
import pytest

import innovant


def closed_loop(samples=2000, seed=1):
    """Example I of van Wingerden, repaired, in closed loop."""
    rng = np.random.default_rng(seed)
    a = np.array([[0.67, 0.67, 0, 0], [-0.67, 0.67, 0, 0], [0, 0, -0.67, -0.67], [0, 0, 0.67, -0.67]])
    b = np.array([[0.6598, 1.9698], [-0.5256, 0.4845], [-0.6968, 0.1722], [0.1474, 0.5646]])
    k = np.array([[-0.6968, -0.1474], [0.1722, 0.5646], [0.6484, -0.4660], [-0.94, 0.1032]])
    c = np.array([[-0.3749, 0.0751, -0.5225, 0.5830], [-0.8977, 0.7543, 0.1159, 0.0982]])
    reference, noise = rng.standard_normal((2, samples, 2))
    x, u, y = np.zeros(4), np.empty((samples, 2)), np.empty((samples, 2))
    for i in range(samples):
        y[i] = c @ x + noise[i]
        u[i] = 0.5 * y[i] + reference[i]
        x = a @ x + b @ u[i] + k @ noise[i]
    return u, y


def test_poles_are_found_in_closed_loop():
    u, y = closed_loop()
    model = innovant.identify(u, y, dt=1.0)
    assert model.order == 4
    poles = np.linalg.eigvals(model.A)
    for true in (0.67 + 0.67j, -0.67 + 0.67j):
        assert np.min(np.abs(poles - true)) < 0.05
    assert model.covariance.shape == (40, 40)
    assert np.linalg.eigvalsh(model.covariance).min() > -1e-12


def test_inputs_are_not_modified_and_layout_does_not_matter():
    u, y = closed_loop(1000)
    before = u.copy(), y.copy()
    model = innovant.identify(u, y, dt=0.5, order=4)
    fortran = innovant.identify(np.asfortranarray(u), np.asfortranarray(y), dt=0.5, order=4)
    assert np.array_equal(u, before[0]) and np.array_equal(y, before[1])
    assert np.array_equal(model.A, fortran.A)
    assert model.dt == 0.5


def test_document_is_that_of_the_command_line():
    u, y = closed_loop(1000)
    document = json.loads(innovant.identify(u, y, dt=1.0, order=4).to_json())
    assert document["format"] == "innovant-model/1"
    assert np.shape(document["A"]) == (4, 4)


def test_errors_are_exceptions_with_the_words_of_the_command_line():
    u, y = closed_loop(500)
    u[:, 1] = 3.0
    with pytest.raises(ValueError, match="'u2' is constant"):
        innovant.identify(u, y, dt=1.0)
    with pytest.raises(ValueError, match="polish"):
        innovant.identify(u, y, dt=1.0, polish="perhaps")
