"""Plants in equations from Python."""

import json

import numpy as np
import pytest

import innovant

TEXT = """model Pendulum
  parameter Real m(unit="kg", min=0.1, max=1) = 0.45;
  parameter Real d(unit="N.m.s/rad", min=0) = 0.04;
  final parameter Real l(unit="m") = 0.4;
  input Real u(unit="N.m");
  output Real y(unit="rad");
  Real phi(unit="rad", start=0);
  Real w(unit="rad/s", start=0);
equation
  der(phi) = w;
  m*l^2*der(w) = u - d*w - m*Modelica.Constants.g_n*l*sin(phi);
  y = phi;
end Pendulum;
"""


def recording(plant, samples=800, seed=1):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1.2, 1.2, samples // 10), 10)
    y = plant.simulate(u, dt=0.03, parameters={"m": 0.5, "d": 0.05}, start={"phi": 0.1})
    return u, y + 0.01 * rng.standard_normal(y.shape)


def test_parameters_are_found_with_their_uncertainty(tmp_path):
    plant = innovant.Plant(TEXT)
    assert (plant.inputs, plant.outputs, plant.states) == (["u"], ["y"], ["phi", "w"])
    u, y = recording(plant)
    fitted = plant.fit(u, y, dt=0.03)
    for name, truth in [("m", 0.5), ("d", 0.05)]:
        found = fitted.estimates[name]
        assert abs(found.value - truth) < 4 * found.std
        assert found.interval_95[0] < found.value < found.interval_95[1]
    assert fitted.document["format"] == "innovant-plant/1"
    assert fitted.undetermined == []
    assert "2 parameters estimated in free run" in " ".join(str(fitted).split())
    fitted.save(tmp_path / "plant.json")
    again = innovant.Plant(tmp_path / "plant.json")
    assert again.parameters == fitted.parameters != plant.parameters
    json.loads((tmp_path / "plant.json").read_text())


def test_outputs_that_are_nan_are_not_compared():
    plant = innovant.Plant(TEXT)
    u, y = recording(plant)
    sparse = y.copy()
    sparse[np.arange(len(y)) % 4 != 0] = np.nan
    every, fourth = (plant.fit(u, of, dt=0.03).estimates["m"] for of in (y, sparse))
    assert abs(fourth.value - 0.5) < 4 * fourth.std
    assert 1.5 < fourth.std / every.std < 2.7
    assert innovant.explain(u, sparse, dt=0.03, simulation=plant).verdict in ("consistent", "parameters")
    u[3] = np.nan
    with pytest.raises(innovant.InnovantError, match="u.*3.*NaN"):
        plant.fit(u, y, dt=0.03)


def test_linearised_at_rest():
    a, b, c, d = innovant.Plant(TEXT).linearise()
    inertia = 0.45 * 0.16
    np.testing.assert_allclose(a, [[0, 1], [-9.80665 / 0.4, -0.04 / inertia]], rtol=1e-9)
    np.testing.assert_allclose(b, [[0], [1 / inertia]], rtol=1e-9)
    np.testing.assert_allclose(c, [[1, 0]])
    np.testing.assert_allclose(d, [[0]])


def test_an_estimate_is_linearised_with_its_uncertainty(tmp_path):
    plant = innovant.Plant(TEXT)
    assert plant.to_modelica() == TEXT
    assert plant.linearisation()["poles"][0]["natural_frequency_std"] is None
    fitted = plant.fit(*recording(plant), dt=0.03)
    pole = fitted.linearisation(inputs=[0.5], frequencies=[1.0, 3.0])["poles"][0]
    # Held up by a torque: sin(phi) = u/(m g l), w^2 = g cos(phi)/l.
    height = 0.5 / (0.5 * 9.80665 * 0.4)
    truth = np.sqrt(9.80665 / 0.4 * np.sqrt(1 - height**2)) / (2 * np.pi)
    assert abs(pole["natural_frequency_hz"] - truth) < 4 * pole["natural_frequency_std"]
    again = innovant.Plant(fitted.to_modelica())
    assert again.parameters == fitted.parameters
    fitted.report(tmp_path / "page.html")
    assert '<section id="parameters"' in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_linearised_for_python_control():
    control = pytest.importorskip("control")
    system = innovant.Plant(TEXT).to_control()
    assert isinstance(system, control.StateSpace) and system.isctime()
    assert (system.input_labels, system.output_labels, system.state_labels) == (["u"], ["y"], ["phi", "w"])
    np.testing.assert_allclose(system.dcgain(), 1 / (0.45 * 9.80665 * 0.4))


def test_two_recordings_are_better_than_one():
    plant = innovant.Plant(TEXT)
    (u1, y1), (u2, y2) = recording(plant), recording(plant, seed=2)
    one, two = plant.fit(u1, y1, dt=0.03), plant.fit([u1, u2], [y1, y2], dt=0.03)
    assert two.estimates["m"].std < one.estimates["m"].std


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: innovant.Plant(TEXT.replace("sin(phi)", "sin(phy)")), "did you mean"),
        (lambda: innovant.Plant(TEXT.replace("sin(phi)", "sin(phy)").replace("der(phi) = w", "der(phi) = v")), "2 errors"),
        (lambda: innovant.Plant(TEXT).simulate(np.ones((5, 2)), dt=0.1), "samples x 1"),
        (lambda: innovant.Plant(TEXT).simulate(np.ones(5), dt=0.1, parameters={"M": 1.0}), "no parameter `M`"),
        (lambda: innovant.Plant(TEXT).fit(np.ones(500), np.ones(500), dt=0.1, fix=["q"]), "no parameter `q`"),
        (lambda: innovant.Plant(TEXT).simulate(np.ones(5), dt=0.1, hold="cubic"), "`zero` or `linear`"),
    ],
)
def test_errors_say_what_to_do(make, words):
    with pytest.raises(innovant.InnovantError, match=words):
        make()
