"""What a simulation leaves out, from Python."""

import json
import pickle
from pathlib import Path

import numpy as np
import pandas
import pytest
import scipy.signal

import innovant


def test_friction_is_named(explanation):
    assert explanation.verdict == "named"
    assert explanation.effects[0].effect == "coulomb_friction"
    size = explanation.effects[0].parameters
    assert 0.5 < explanation.probability <= 1.0
    assert size and all(np.isfinite(number.value) for number in size.values())
    assert explanation.where.outputs == ["y1"]
    assert explanation.fit.heldout.augmented.rmse < explanation.fit.heldout.parameters_only.rmse
    assert explanation.alternatives and explanation.summary and explanation.remaining.features > 0


def test_it_can_be_simulated(explanation, friction):
    u = np.repeat(np.random.default_rng(5).normal(0.0, 2.0, 60), 10)
    truth, without = friction.truth(u), friction.simulate(u)
    error = explanation.simulate(u) - truth
    assert error.shape == u.shape
    assert np.sqrt(np.mean(error**2)) < 0.2 * np.sqrt(np.mean((without - truth) ** 2))


def test_every_kind_of_simulation_says_the_same(explanation, friction):
    simulated = friction.simulate(friction.u)
    from_array = innovant.explain(friction.u, friction.y, simulation=simulated, dt=friction.dt)
    assert from_array.to_json() == explanation.to_json()
    a, b = np.array([[0.0, 1.0], [-25.0, -1.0]]), np.array([[0.0], [1.0]])
    sampled = scipy.signal.cont2discrete((a, b, np.array([[1.0, 0.0]]), np.zeros((1, 1))), friction.dt)
    model = innovant.Model(*sampled[:4], dt=friction.dt)
    for simulation in (model, model.to_control(), model.to_scipy()):
        found = innovant.explain(friction.u, friction.y, simulation=simulation, dt=friction.dt)
        assert found.effects[0].effect == "coulomb_friction"


def test_documents_pickles_pages(explanation, tmp_path):
    for restored in (innovant.Explanation.from_json(explanation.to_json()), pickle.loads(pickle.dumps(explanation))):
        assert restored.to_json() == explanation.to_json()
    explanation.report(tmp_path / "page.html")
    assert "<html" in (tmp_path / "page.html").read_text()
    assert list(tmp_path.iterdir()) == [tmp_path / "page.html"]
    explanation.to_json(tmp_path / "explanation.json")
    assert json.loads((tmp_path / "explanation.json").read_text())["format"] == "innovant-explanation/1"
    shown = explanation._repr_html_()
    assert "named" in shown and explanation.effects[0].sentence.split(",")[0] in shown
    assert repr(explanation).startswith("innovant.Explanation(named: coulomb_friction")
    assert str(explanation).startswith("NAMED")


def test_errors_have_the_words_of_the_command_line(friction):
    u, y, dt = friction.u, friction.y, friction.dt
    for simulation, words in [
        (y[:100], "100 samples, and .* has 1500; simulate exactly the recorded input"),
        (np.stack([y, y], axis=1), "2"),
        ([y, y], "give one simulation"),
        (innovant.Model([[0.5]], [[1.0]], [[1.0]], dt=0.5), "sample time 0.5 s"),
        (scipy.signal.StateSpace([[-1.0]], [[1.0]], [[1.0]], [[0.0]]), "sample time"),
    ]:
        with pytest.raises(innovant.InnovantError, match=words):
            innovant.explain(u, y, simulation=simulation, dt=dt)
    with pytest.raises(innovant.InnovantError, match="no effect called"):
        innovant.explain(u, y, simulation=y, dt=dt, without=["gremlins"])


def test_a_simulator_whose_equations_are_found_simulates_without_it():
    """Frames give frames; equations that reproduce the columns are kept with the explanation."""
    case = Path(__file__).parents[2] / "data" / "concealed" / "case_010"
    recording, simulated = pandas.read_csv(case / "recording.csv"), pandas.read_csv(case / "simulation.csv")
    new, answer = pandas.read_csv(case / "fresh_input.csv"), pandas.read_csv(case / "fresh_simulation.csv")
    found = innovant.explain(recording, simulation=simulated)
    truth = pandas.read_csv(case.parent / "truth" / "case_010_fresh.csv")
    outputs = ["y1"]
    simulation = found.simulate(new)
    assert list(simulation.columns) == outputs
    error = simulation.to_numpy() - truth[outputs].to_numpy()
    before = answer[outputs].to_numpy() - truth[outputs].to_numpy()
    assert np.sqrt(np.mean(error**2)) < 0.3 * np.sqrt(np.mean(before**2))
    restored = pickle.loads(pickle.dumps(found))
    assert np.array_equal(restored.simulate(new), simulation)


def logarithmic(u):
    """A simulator that no equations with few terms reproduce: the scale of its output is a logarithm."""
    return np.arcsinh(4.0 * scipy.signal.lfilter([0.05], [1.0, -0.95], np.ravel(u)))


def steps(rng):
    return np.repeat(rng.uniform(-1.5, 1.5, 100), 30)


def test_a_sensor_is_found_whatever_the_simulator_is():
    """Its explanation asks the simulator again for new inputs."""
    rng = np.random.default_rng(3)
    u = steps(rng)
    y = np.minimum(logarithmic(u), 1.0) + 0.01 * rng.standard_normal(len(u))
    found = innovant.explain(u, y, simulation=logarithmic, dt=0.01)
    assert [effect.effect for effect in found.effects] == ["sensor_saturation"]
    new = steps(rng)
    simulation = found.simulate(new)
    assert np.sqrt(np.mean((np.ravel(simulation) - np.minimum(logarithmic(new), 1.0)) ** 2)) < 0.01
    restored = pickle.loads(pickle.dumps(found))
    with pytest.raises(innovant.InnovantError, match="y1_simulated; give the simulator's answer"):
        restored.simulate(new)
    assert np.array_equal(restored.simulate(new, simulation=logarithmic(new)), simulation)


def test_a_simulator_that_is_not_linear_corrects_its_own_answer():
    """Known by its outputs alone, it is asked again for new inputs."""

    def rounded(u):
        """A simulator that no equations reproduce: it shows its output in thirds."""
        return np.round(3.0 * scipy.signal.lfilter([0.05], [1.0, -0.95], np.ravel(u))) / 3.0

    rng = np.random.default_rng(3)
    u = steps(rng)
    y = rounded(np.minimum(u, 1.0)) + 0.01 * rng.standard_normal(len(u))
    found = innovant.explain(u, y, simulation=rounded, dt=0.01)
    assert "input_saturation" in [effect.effect for effect in found.effects]
    new = steps(rng)
    simulation = found.simulate(new)
    restored = pickle.loads(pickle.dumps(found))
    with pytest.raises(innovant.InnovantError, match="relative to a simulator that is not linear"):
        restored.simulate(new)
    assert np.array_equal(restored.simulate(new, simulation=rounded(new)), simulation)
