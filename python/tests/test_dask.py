"""On a real cluster of two worker processes: the model is that of one machine, also when a worker dies."""

import os
import signal
import time

import dask
import dask.bag
import dask.dataframe
import numpy as np
import pandas
import pytest
from dask.distributed import Client, LocalCluster

import innovant
import innovant.dask

CHUNK = 1000


@pytest.fixture(scope="module")
def client():
    dask.config.set({"distributed.scheduler.allowed-failures": 10})
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        with Client(cluster) as client:
            client.wait_for_workers(2)
            yield client


@dask.delayed
def load(seed, index, pause=0.0):
    """One chunk of a recording, as a worker would read it from its disk."""
    time.sleep(pause)
    u, y, _ = innovant.examples.closed_loop(4 * CHUNK, seed=seed)
    rows = slice(index * CHUNK, (index + 1) * CHUNK)
    return u[rows], y[rows]


def expected(seeds, **options):
    recordings = [innovant.examples.closed_loop(4 * CHUNK, seed=seed) for seed in seeds]
    return innovant.identify([r[0] for r in recordings], [r[1] for r in recordings], dt=1.0, **options)


def same(found, model):
    for name in ("A", "B", "C", "D", "K", "innovation_covariance", "covariance"):
        difference = np.abs(getattr(found, name) - getattr(model, name)).max()
        assert difference < 1e-10, (name, difference)
    assert np.abs(found.x0 - model.x0).max() < 1e-8


def test_chunks_and_recordings_give_the_model_of_one_machine(client):
    logs = [[load(seed, index) for index in range(4)] for seed in (1, 2, 3)]
    same(innovant.dask.identify(logs, dt=1.0), expected([1, 2, 3]))
    same(innovant.dask.identify(logs[0], dt=1.0), expected([1]))


def test_a_worker_that_dies_changes_nothing(client):
    slow = [[load(seed, index, pause=0.3) for index in range(4)] for seed in (1, 2, 3)]
    before = set(client.run(os.getpid).values())
    future = client.compute(innovant.dask.moments(slow, dt=1.0))
    time.sleep(1.0)
    assert future.status == "pending"
    victim = sorted(before)[0]
    os.kill(victim, signal.SIGKILL)
    same(future.result(timeout=300).identify(), expected([1, 2, 3]))
    client.wait_for_workers(2, timeout=120)
    assert victim not in client.run(os.getpid).values()


def test_known_delays_overlap(client):
    chunks = [load(1, index) for index in range(4)]
    found = innovant.dask.identify(chunks, dt=1.0, order=4, delay=[3, 1])
    same(found, expected([1], order=4, delay=[3, 1]))


def test_bags_are_recordings_and_frames_are_chunks(client):
    bag = dask.bag.from_sequence([1, 2, 3], npartitions=2).map(lambda seed: innovant.examples.closed_loop(4000, seed)[:2])
    found = innovant.dask.identify(bag, dt=1.0, order=4)
    # A bag has no order: the experiments may be summed in another one.
    model = expected([1, 2, 3], order=4)
    assert np.allclose(
        found.frequency_response([0.5]).response, model.frequency_response([0.5]).response, atol=1e-9
    )
    u, y, _ = innovant.examples.closed_loop(4 * CHUNK, seed=1)
    frame = pandas.DataFrame(np.hstack([u, y]), columns=["u1", "u2", "y1", "y2"])
    chunks = dask.dataframe.from_pandas(frame, npartitions=4)
    same(innovant.dask.identify(chunks, dt=1.0), expected([1]))


def test_explanations_come_back_in_their_order(client, friction):
    good = (friction.u, friction.y, friction.simulate(friction.u))
    bad = (friction.u, friction.y, friction.y[:100])
    answers = innovant.dask.explain_many([dask.delayed(good), bad, dask.delayed(good)], dt=friction.dt)
    assert [type(answer).__name__ for answer in answers] == ["Explanation", "InnovantError", "Explanation"]
    assert answers[0].effects[0].effect == "coulomb_friction"
    assert answers[0].to_json() == answers[2].to_json()
    assert "simulate exactly the recorded input" in str(answers[1])


def test_what_cannot_be_read_is_refused():
    for nothing in ([], [[]], "logs"):
        with pytest.raises(innovant.InnovantError):
            innovant.dask.moments(nothing, dt=1.0)
