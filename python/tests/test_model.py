"""What a model can do."""

import copy
import json
import pickle

import control
import numpy as np
import pytest
import scipy.signal

import innovant


def test_responses_are_those_of_the_matrices(model):
    omega = np.array([0.1, 0.8, 2.0])
    found = model.frequency_response(omega)
    for k, w in enumerate(omega):
        z = np.exp(1j * w * model.dt)
        expected = model.C @ np.linalg.solve(z * np.eye(4) - model.A, model.B) + model.D
        assert np.allclose(found.response[:, :, k], expected, rtol=1e-10)
        noise = model.C @ np.linalg.solve(z * np.eye(4) - model.A, model.K) + np.eye(2)
        assert np.allclose(model.noise_response(w).response[:, :, 0], noise, rtol=1e-10)
    assert found.covariance.shape == (2, 2, 3, 2, 2)
    assert np.all(np.linalg.eigvalsh(found.covariance) > 0)
    assert np.all(found.magnitude_95[..., 0] < found.magnitude) and np.all(found.magnitude < found.magnitude_95[..., 1])
    assert np.all(found.magnitude_99[..., 1] >= found.magnitude_95[..., 1])
    assert np.allclose(found.frequency, omega / (2 * np.pi))
    whole = model.frequency_response()
    assert whole.omega[-1] == pytest.approx(np.pi) and len(whole.omega) == 200
    with pytest.raises(innovant.InnovantError, match="Nyquist"):
        model.frequency_response([1.0, 4.0])


def test_poles_zeros_steps(model):
    poles = model.poles()
    assert np.allclose(np.sort_complex(np.asarray(poles)), np.sort_complex(np.linalg.eigvals(model.A)))
    assert len(poles) == 4 and np.all(poles.natural_frequency_std > 0) and np.all(poles.damping_std > 0)
    assert model.zeros().covariance.shape[1:] == (2, 2)
    step = model.step_response(300)
    gain, std = model.static_gain()
    assert np.allclose(step.outputs[:, :, -1], gain, atol=1e-8)
    assert np.allclose(step.std[:, :, -1], std, rtol=1e-6)
    assert np.allclose(step.time, np.arange(300))
    assert len(model.step_response().time) >= 20


def test_simulation_is_that_of_scipy(model, closed_loop):
    simulated = model.simulate(closed_loop.u)
    _, expected, _ = scipy.signal.dlsim(model.to_scipy(), closed_loop.u - model.input_levels)
    assert np.allclose(simulated, expected + model.output_levels, atol=1e-10)
    assert model.simulate(closed_loop.u, x0=model.x0)[0] == pytest.approx(model.C @ model.x0 + model.output_levels, abs=0.2)


def test_predictions_leave_the_innovations(model, closed_loop):
    innovations = closed_loop.y - model.predict(closed_loop.u, closed_loop.y)
    assert np.allclose(np.cov(innovations.T), model.innovation_covariance, atol=0.05)
    start = model.initial_state(closed_loop.u, closed_loop.y)
    assert np.array_equal(
        model.predict(closed_loop.u, closed_loop.y), model.predict(closed_loop.u, closed_loop.y, x0=start)
    )


def test_validation_accepts_the_right_and_rejects_the_wrong(model):
    u, y, dt = innovant.examples.closed_loop(2000, seed=7)
    accepted = model.validate(u, y)
    assert accepted and not accepted.rejected and accepted.one_step.fit_percent > 60
    assert accepted.relation == "fresh" and "whiteness" in dir(accepted.to_dict())
    assert "one step" in str(accepted)
    wrong = innovant.identify(u, y, dt=dt, order=2)
    rejected = wrong.validate(*innovant.examples.closed_loop(2000, seed=8)[:2])
    assert rejected.rejected and rejected.findings
    own = model.validate(*innovant.examples.closed_loop(2000, seed=1)[:2], fresh=False)
    assert own.whiteness.p_value == pytest.approx(model.residual_tests.whiteness.p_value, rel=1e-6)
    assert model.validate([u, u], [y, y]).samples == 4000
    with pytest.raises(innovant.InnovantError, match="level"):
        model.validate(u, y, level=2.0)


def test_documents_and_pickles_hold_everything(model, tmp_path):
    for restored in (
        innovant.Model.from_json(model.to_json()),
        pickle.loads(pickle.dumps(model)),
        copy.deepcopy(model),
    ):
        assert restored.to_json() == model.to_json()
        assert np.array_equal(restored.covariance, model.covariance)
        assert restored.residual_tests == model.residual_tests
    model.to_json(tmp_path / "model.json")
    assert innovant.Model.from_json(tmp_path / "model.json").verdict == model.verdict
    with pytest.raises(innovant.InnovantError, match="there is no key `A`"):
        innovant.Model.from_json('{"B": [[1]], "C": [[1]], "dt": 1}')
    with pytest.raises(innovant.InnovantError, match="cannot open"):
        innovant.Model.from_json(tmp_path / "nothing.json")


def test_python_control_and_scipy(model):
    system = model.to_control()
    assert isinstance(system, control.StateSpace) and system.dt == 1.0
    assert system.input_labels == ["u1", "u2"] and system.output_labels == ["y1", "y2"]
    at = system(np.exp(0.8j))
    assert np.allclose(at, model.frequency_response(0.8).response[:, :, 0])
    assert np.allclose(np.sort_complex(system.poles()), np.sort_complex(np.asarray(model.poles())))
    assert isinstance(model.to_scipy(), scipy.signal.StateSpace)


def test_known_delays_become_states_elsewhere(closed_loop):
    u, y = closed_loop.u, closed_loop.y
    delayed = innovant.identify(u, y, dt=1.0, order=4, delay=[3, 0], feedthrough=True)
    system = delayed.to_scipy()
    assert system.A.shape == (7, 7)
    impulse = np.zeros((30, 2))
    impulse[0] = 1.0
    _, expected, _ = scipy.signal.dlsim(system, impulse)
    # Before the first sample the model's inputs stand still at what they begin with; here at zero.
    offset = np.vstack([np.zeros((5, 2)), impulse]) + delayed.input_levels
    assert np.allclose(delayed.simulate(offset)[5:] - delayed.output_levels, expected, atol=1e-10)


def test_models_out_of_matrices():
    model = innovant.Model([[0.5, 0.1], [0.0, 0.2]], [[1.0], [1.0]], [[1.0, 0.0]], dt=0.1)
    assert model.covariance is None and model.innovation_covariance is None and model.residual_tests is None
    assert np.isnan(model.poles().natural_frequency_std).all()
    assert model.frequency_response([1.0]).covariance is None
    assert model.step_response(5).std is None
    assert "without uncertainty" in model.verdict
    assert model.simulate(np.ones(4)).shape == (4,)
    unstable = innovant.Model([[2.0]], [[1.0]], [[1.0]], dt=1.0)
    with pytest.raises(innovant.InnovantError, match="diverges: output y1"):
        unstable.simulate(np.ones(2000))
    with pytest.raises(innovant.InnovantError, match="B is 1 x 2"):
        innovant.Model(np.eye(3), [[1.0, 2.0]], [[1.0, 0.0, 0.0]], dt=1.0)


def test_data_that_do_not_fit_are_refused(model, closed_loop):
    with pytest.raises(innovant.InnovantError, match=r"u has the shape \(2000,\), 1 channel; expected samples x 2"):
        model.simulate(closed_loop.u[:, 0])
    with pytest.raises(innovant.InnovantError):
        model.predict(closed_loop.u, closed_loop.y[:10])
    with pytest.raises(innovant.InnovantError):
        model.simulate(closed_loop.u, x0=[1.0])


def test_what_notebooks_show(model):
    page = model._repr_html_()
    assert page.count("<tr>") == 3 and "±" in page and model.verdict in page
    assert " ".join(str(model).split()).startswith(model.verdict)
    assert repr(model) == "innovant.Model(order=4, inputs=['u1', 'u2'], outputs=['y1', 'y2'], dt=1.0)"


@pytest.mark.parametrize("backend", ["plotly", "matplotlib"])
def test_plots(model, backend):
    bode, poles = model.plot_bode(backend=backend), model.plot_poles(backend=backend)
    if backend == "plotly":
        # A curve and a band of magnitude and of phase for each of four pairs.
        assert len(bode.data) == 16
        drawn = json.loads(bode.to_json())["data"]
        assert all(len(trace["x"]) for trace in drawn)
        assert [t.name for t in poles.data if t.mode == "markers"] == ["poles", "zeros"]
    else:
        magnitude = bode.axes[0].lines[0].get_ydata()
        assert np.allclose(magnitude, model.frequency_response().magnitude[0, 0])
        assert len(poles.axes[0].patches) == 4
    with pytest.raises(innovant.InnovantError, match="backend"):
        model.plot_bode(backend="crayon")


def test_the_page_is_one_file(model, tmp_path):
    model.report(tmp_path / "page.html")
    assert list(tmp_path.iterdir()) == [tmp_path / "page.html"]
    page = (tmp_path / "page.html").read_text()
    assert "<html" in page and "Frequency response" in page
