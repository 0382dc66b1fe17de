"""Several models on one recording."""

import numpy as np
import pandas
import pytest
import scipy.signal

import innovant


@pytest.fixture(scope="module")
def fresh():
    return innovant.examples.closed_loop(1500, seed=9)[:2]


@pytest.fixture(scope="module")
def small(closed_loop):
    return innovant.identify(closed_loop.u, closed_loop.y, dt=1.0, order=2)


def literal_fit(y, simulated):
    return 100 * (1 - np.linalg.norm(y - simulated, axis=0) / np.linalg.norm(y - y.mean(axis=0), axis=0))


def test_figures_are_those_of_the_simulations(model, small, fresh):
    u, y = fresh
    found = innovant.compare((u, y), model, small, dt=1.0, names=["large", "small"])
    for m, one in enumerate((model, small)):
        simulated = one.simulate(u, x0=one.initial_state(u, y))
        assert np.array_equal(found.simulated[found.names[m]][0], simulated)
        assert np.allclose(found.fit_percent[m], literal_fit(y, simulated), rtol=1e-12)
        assert np.allclose(found.rmse[m], np.sqrt(np.mean((y - simulated) ** 2, axis=0)), rtol=1e-12)
        assert np.array_equal(found.residuals(found.names[m])[0], y - simulated)
    # The free-run fit that `validate` states, which leaves out its start-up.
    stated = [output.fit_percent for output in model.validate(u, y).free_run.outputs]
    assert np.allclose(found.fit_percent[0], stated, atol=0.5)
    assert found.to_dict()["large"]["y2"]["fit_percent"] == found.fit_percent[0, 1]


def test_a_table_of_models_and_outputs(model, small, fresh):
    found = innovant.compare(fresh, model, small, dt=1.0)
    lines = repr(found).splitlines()
    assert lines[0] == "Free run on 1 recording, 1500 samples, dt = 1 s"
    assert lines[1].split() == ["model", "output", "fit", "rmse"]
    assert lines[2].startswith("model of order 4  y1") and f"{found.fit_percent[0, 0]:.2f} %" in lines[2]
    assert lines[3].split()[0] == "y2" and len(lines) == 6
    assert found._repr_html_().count("<tr>") == 5


def test_initial_states(model):
    """Estimated, a model follows a recording that starts elsewhere; from its operating point it does not."""
    u = np.random.default_rng(3).normal(size=(60, 2))
    y = model.simulate(u, x0=[8.0, -5.0, 3.0, 6.0])
    estimated = innovant.compare((u, y), model, dt=1.0)
    assert np.all(estimated.fit_percent > 99.999)
    assert np.all(innovant.compare((u, y), model, dt=1.0, initial="zero").fit_percent < 90)


def test_every_kind_of_model(friction, explanation):
    u = np.repeat(np.random.default_rng(5).normal(0.0, 2.0, 60), 10)
    y = friction.truth(u)
    a, b = np.array([[0.0, 1.0], [-25.0, -1.0]]), np.array([[0.0], [1.0]])
    sampled = scipy.signal.cont2discrete((a, b, np.array([[1.0, 0.0]]), np.zeros((1, 1))), friction.dt)
    linear = innovant.Model(*sampled[:4], dt=friction.dt)
    plant = innovant.Plant(
        "model Mass\n input Real u; output Real y; Real x(start=0, fixed=true); Real v(start=0, fixed=true);\n"
        "equation\n der(x) = v; der(v) = u - 25*x - v; y = x;\nend Mass;"
    )
    simulator = innovant.Simulator(lambda u, c: c * friction.simulate(u), {"c": 1.0})
    models = [explanation, linear, linear.to_scipy(), plant, simulator, friction.simulate, friction.simulate(u)]
    found = innovant.compare((u, y), *models, dt=friction.dt)
    fits = found.fit_percent[:, 0]
    assert found.names[0] == "explanation: coulomb_friction" and found.names[3] == "Mass"
    assert len(set(found.names)) == len(models)
    # With friction in it the simulation follows; all others are the same plant without friction.
    assert fits[0] > 90 and np.all(fits[1:] < 60)
    assert fits[4] == fits[5] == fits[6]
    # The equations state their initial states, the matrices do not.
    assert fits[1] == pytest.approx(fits[2]) and fits[1] > fits[3]
    at_rest = innovant.compare((u, y), linear, plant, dt=friction.dt, initial="zero").fit_percent[:, 0]
    assert at_rest[1] == fits[3] == pytest.approx(at_rest[0], abs=0.01)


def test_frames_and_channels_by_name(closed_loop, fresh):
    names = ["u1", "u2", "y1", "y2"]
    frame = pandas.DataFrame(np.hstack(fresh), columns=names, index=pandas.timedelta_range(0, periods=1500, freq="1s"))
    both = innovant.identify(closed_loop.u, closed_loop.y, dt=1.0, order=4)
    one = innovant.identify(closed_loop.u, closed_loop.y[:, 1], dt=1.0, order=4, outputs="y2")
    found = innovant.compare(frame[["y2", "u2", "y1", "u1"]], both, one, names=["both", "one"])
    assert found.dt == 1.0 and found.outputs == ["y1", "y2"]
    expected = innovant.compare(fresh, both, dt=1.0)
    assert np.array_equal(found.fit_percent[0], expected.fit_percent[0])
    # An output that a model has not.
    assert np.isnan(found.fit_percent[1, 0]) and found.fit_percent[1, 1] > 0
    assert repr(found).splitlines()[4].split() == ["one", "y1", "-", "-"]


def test_several_recordings(model, fresh):
    other = innovant.examples.closed_loop(800, seed=4)[:2]
    found = innovant.compare([fresh, other], model, dt=1.0)
    error = spread = 0.0
    for u, y in (fresh, other):
        simulated = model.simulate(u, x0=model.initial_state(u, y))
        error = error + np.sum((y - simulated) ** 2, axis=0)
        spread = spread + np.sum((y - y.mean(axis=0)) ** 2, axis=0)
    assert np.allclose(found.fit_percent[0], 100 * (1 - np.sqrt(error / spread)))
    assert [len(y) for y in found.measured] == [1500, 800]
    frames = [pandas.DataFrame(np.hstack(part), columns=["u1", "u2", "y1", "y2"]) for part in (fresh, other)]
    assert np.array_equal(innovant.compare(frames, model, dt=1.0).fit_percent, found.fit_percent)


def test_errors_name_the_model(model, fresh):
    u, y = fresh
    for wrong, words in [
        (lambda: innovant.compare((u, y), dt=1.0), "nothing to compare"),
        (lambda: innovant.compare((u, y), model), "the sample time is not known"),
        (lambda: innovant.compare((u, y), model, dt=0.5), r"model of order 4: the data have dt = 0\.5 s and the model dt = 1 s"),
        (lambda: innovant.compare((u, y), model, dt=1.0, initial="somewhere"), "expected one of estimate, zero"),
        (lambda: innovant.compare((u, y), model, model, dt=1.0, names=["a", "a"]), "a different one for each"),
        (lambda: innovant.compare((u, y), "model.json", dt=1.0), "model 1 is a str; expected a Model"),
        (lambda: innovant.compare(u, model, dt=1.0), r"data is a ndarray; expected a pair \(u, y\)"),
        (lambda: innovant.compare((u, y), y[:9], dt=1.0), r"simulation: it has the shape \(9, 2\)"),
        (lambda: innovant.compare((u, y), y[:, 0], dt=1.0), r"simulation has the shape \(1500,\), 1 channel"),
        (lambda: innovant.compare((u[:, 0], y), model, dt=1.0), r"model of order 4: u has the shape \(1500, 1\)"),
        (lambda: innovant.compare((u, y), scipy.signal.StateSpace(-1.0, 1.0, 1.0, 0.0), dt=1.0), "no sample time"),
        (lambda: innovant.compare((u, y), model, dt=1.0).residuals("best"), "there is no model 'best'; there are: model of"),
    ]:
        with pytest.raises(innovant.InnovantError, match=words):
            wrong()
