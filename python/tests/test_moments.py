"""Moments join, add and pickle, exactly."""

import pickle

import numpy as np
import pytest

import innovant


def same(found, expected, tolerance=1e-10):
    """The two models agree: matrices and covariance."""
    for name in ("A", "B", "C", "D", "K", "innovation_covariance", "covariance"):
        difference = np.abs(getattr(found, name) - getattr(expected, name)).max()
        assert difference < tolerance, (name, difference)


def test_chunks_join_to_the_whole(closed_loop):
    u, y = closed_loop.u, closed_loop.y
    parts = [
        innovant.Moments(u[a:b], y[a:b], dt=1.0, keep=20_000 if a == 0 else 0)
        for a, b in [(0, 300), (300, 310), (310, 1500), (1500, 2000)]
    ]
    left = parts[0].append(parts[1]).append(parts[2]).append(parts[3])
    right = parts[0].append(parts[1].append(parts[2].append(parts[3])))
    assert left.samples == 2000 and left.recordings == 1
    for whole in (left, right, pickle.loads(pickle.dumps(left))):
        same(whole.identify(), innovant.identify(u, y, dt=1.0))


def test_pickles_are_exact(closed_loop):
    moments = innovant.Moments(closed_loop.u, closed_loop.y, dt=1.0, order=4, past=12)
    restored = pickle.loads(pickle.dumps(moments))
    assert restored.__reduce__() == moments.__reduce__()
    assert restored.identify().to_json() == moments.identify().to_json()
    assert "lags=12" in repr(restored)


def test_recordings_add(closed_loop):
    other = innovant.examples.closed_loop(1500, seed=2)
    total = innovant.Moments(closed_loop.u, closed_loop.y, dt=1.0) + innovant.Moments(other[0], other[1], dt=1.0)
    expected = innovant.identify([closed_loop.u, other[0]], [closed_loop.y, other[1]], dt=1.0)
    same(total.identify(), expected)
    assert total.recordings == 2
    with pytest.raises(TypeError):
        total + 1


def test_delays_take_their_overlap(closed_loop):
    u, y = closed_loop.u, closed_loop.y
    first = innovant.Moments(u[:700], y[:700], dt=1.0, delay=[2, 0], order=4)
    second = innovant.Moments(u[698:], y[698:], dt=1.0, delay=[2, 0], order=4, overlap=2, keep=0)
    same(first.append(second).identify(), innovant.identify(u, y, dt=1.0, delay=[2, 0], order=4))
    with pytest.raises(innovant.InnovantError, match="overlaps the one before by 1 samples"):
        innovant.Moments(u, y, dt=1.0, delay=2, overlap=1)


def test_what_does_not_belong_together(closed_loop):
    u, y = closed_loop.u, closed_loop.y
    moments = innovant.Moments(u, y, dt=1.0, past=10)
    with pytest.raises(innovant.InnovantError, match="different lags"):
        moments.append(innovant.Moments(u, y, dt=1.0, past=11))
    with pytest.raises(innovant.InnovantError, match="sample time"):
        moments + innovant.Moments(u, y, dt=0.5, past=10)
    with pytest.raises(innovant.InnovantError, match="10 lags"):
        moments.identify(past=20)
    with pytest.raises(innovant.InnovantError, match="samples themselves"):
        innovant.Moments(u, y, dt=1.0, method="pem", order=2).identify()
    with pytest.raises(innovant.InnovantError, match="no option ordre"):
        innovant.Moments(u, y, dt=1.0, ordre=4)
