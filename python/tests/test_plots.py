"""Plots show the numbers of what they are plots of."""

import builtins
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pytest

import innovant

TEXT = """model Cart
  parameter Real a(unit="1/s", min=0.01, max=10) = 0.5;
  parameter Real b(min=0.1, max=10) = 1.0;
  input Real u(unit="N");
  output Real y(unit="m/s");
  Real v(unit="m/s", start=0);
equation
  der(v) = b*u - a*v;
  y = v;
end Cart;
"""
DRAG = TEXT.replace("- a*v;", "- a*v - 0.3*v*abs(v);")


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def recording(text, seed=3):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.normal(0.0, 4.0, 60), 10)
    return u, innovant.Plant(text).simulate(u, 0.1)[:, 0] + 0.01 * rng.standard_normal(600)


@pytest.fixture(scope="module")
def fitted():
    return innovant.Plant(TEXT).fit(*recording(TEXT), dt=0.1)


@pytest.fixture(scope="module")
def drag():
    return innovant.explain(*recording(DRAG), simulation=innovant.Plant(TEXT), dt=0.1, only=["quadratic_drag"])


def line(axes, label):
    (found,) = [one for one in axes.lines if one.get_label() == label]
    return np.asarray(found.get_ydata())


def legend(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def band(axes, index=0):
    """Corners of a filled band."""
    return axes.collections[index].get_paths()[0].vertices


def test_frequency_response(closed_loop):
    model = innovant.identify(
        closed_loop.u, closed_loop.y, dt=0.5, order=4, inputs=["force [N]", "torque [N.m]"], outputs=["x [m]", "phi [rad]"]
    )
    response = model.frequency_response()
    axes = response.plot()
    assert axes.shape == (4, 2)
    for o in range(2):
        for i in range(2):
            above, below = axes[2 * o, i], axes[2 * o + 1, i]
            assert np.allclose(above.lines[0].get_xdata(), response.frequency)
            assert np.allclose(above.lines[0].get_ydata(), response.magnitude[o, i])
            turned = np.exp(1j * np.radians(below.lines[0].get_ydata()))
            assert np.allclose(turned, np.exp(1j * response.phase[o, i]))
            low, high = response.magnitude_95[o, i].T
            corners = band(above)[:, 1]
            assert corners.max() == pytest.approx(high.max()) and corners.min() == pytest.approx(low.min())
            # The Nyquist frequency: 1 Hz.
            assert above.lines[1].get_xdata()[0] == 1.0
    assert axes[0, 0].get_ylabel() == "magnitude [m/N]" and axes[2, 1].get_ylabel() == "magnitude [rad/(N.m)]"
    assert axes[0, 1].get_title() == "x / torque" and axes[3, 0].get_xlabel() == "frequency [Hz]"
    assert (axes[0, 0].get_xscale(), axes[0, 0].get_yscale(), axes[1, 0].get_yscale()) == ("log", "log", "linear")
    assert axes[1, 0].get_ylabel() == "phase [°]" and legend(axes[0, 0]) == ["95 % band"]
    decibels = response.plot(decibels=True)
    assert np.allclose(decibels[0, 0].lines[0].get_ydata(), 20 * np.log10(response.magnitude[0, 0]))
    assert decibels[0, 0].get_ylabel() == "magnitude [dB, 1 m/N]"
    assert np.allclose(model.plot([0.5, 1.0])[0, 0].lines[0].get_ydata(), model.frequency_response([0.5, 1.0]).magnitude[0, 0])
    assert model.noise_response([1.0, 2.0]).plot()[0, 1].get_title() == "x / e(phi)"


def test_phase_bands_go_where_the_curve_goes():
    """A lag of three poles turns by more than half a turn: curve and band do not jump there."""
    u, y, dt = innovant.examples.servo(4000)
    response = innovant.identify(u, y, dt=dt, order=3).frequency_response()
    assert np.abs(np.diff(response.phase[0, 0])).max() > np.pi
    below = response.plot()[1, 0]
    phase = np.asarray(below.lines[0].get_ydata())
    assert np.abs(np.diff(phase)).max() < 90
    low, high = response.curves()[0][0].phase_95.T
    assert np.all(low <= phase) and np.all(phase <= high)


def test_responses_of_several_models_in_one_plot(model, closed_loop):
    axes = model.plot(label="four")
    small = innovant.identify(closed_loop.u, closed_loop.y, dt=1.0, order=2)
    again = small.plot(ax=axes, label="two")
    assert again is not None and np.all(again == axes)
    assert legend(axes[0, 0]) == ["four", "four, 95 % band", "two", "two, 95 % band"]
    first, second = (one for one in axes[0, 0].lines if one.get_label() in ("four", "two"))
    assert first.get_color() != second.get_color()
    # A figure gets the axes that it needs.
    figure = plt.figure()
    assert model.plot(ax=figure)[0, 0].figure is figure


def test_a_model_without_uncertainty_has_no_band():
    lag = innovant.Model([[0.9]], [[0.1]], [[1.0]], dt=0.01)
    axes = lag.plot()
    assert axes.shape == (2, 1) and not axes[0, 0].collections and axes[0, 0].get_legend() is None
    assert axes[0, 0].get_ylabel() == "magnitude"
    assert not lag.step_response().plot()[0, 0].collections


def test_poles_and_zeros(model):
    poles = model.poles()
    axes = poles.plot()
    assert np.array_equal(line(axes, "poles"), poles.values.imag)
    assert len(axes.patches) == 4 and axes.get_xlabel() == "real part" and axes.get_aspect() == 1.0
    # Ellipses are those of the covariance: their extent along the real axis is sqrt(5.99) standard deviations.
    corners = axes.patches[0].get_path().vertices
    wanted = np.sqrt(5.991464547107979 * poles.covariance[0, 0, 0])
    assert np.ptp(corners[:, 0]) / 2 == pytest.approx(wanted, rel=1e-3)
    assert model.zeros().plot(ax=axes) is axes
    assert np.array_equal(line(axes, "zeros"), model.zeros().values.imag)


def test_step_response(model):
    step = model.step_response(40)
    axes = step.plot()
    assert axes.shape == (2, 2)
    assert np.array_equal(axes[1, 0].lines[0].get_ydata(), step.outputs[1, 0])
    high = step.outputs[1, 0] + 1.959963984540054 * step.std[1, 0]
    assert band(axes[1, 0])[:, 1].max() == pytest.approx(high.max())
    assert axes[1, 0].get_xlabel() == "time [s]" and axes[0, 1].get_title() == "step of u2"


def test_residual_correlations(model, closed_loop):
    u, y, _ = innovant.examples.closed_loop(2000, seed=7)
    judged = model.validate(u, y)
    axes = judged.plot()
    # Two outputs; two residuals and two inputs that they are correlated with.
    assert axes.shape == (2, 4)
    pair = next(p for p in judged.cross_correlation if (p["from"], p["to"]) == ("u2", "y1"))
    drawn = axes[0, 3]
    assert drawn.get_title() == "u2 → residual of y1"
    dots = [one for one in drawn.lines if one.get_marker() == "o"]
    heights = {lag: value for one in dots for lag, value in zip(one.get_xdata(), one.get_ydata())}
    assert [heights[lag] for lag in pair.lags] == pytest.approx(pair["values"])
    assert band(drawn)[:, 1].max() == pytest.approx(max(pair.bounds_99))
    assert axes[1, 1].get_title() == "autocorrelation of the residual of y2"
    assert axes[0, 0].figure.get_suptitle() == "The tests do not reject the model at the 1 % level"
    small = innovant.identify(closed_loop.u, closed_loop.y, dt=1.0, order=2).validate(u, y)
    assert small.plot()[0, 0].figure.get_suptitle() == "The tests reject the model at the 1 % level"


def test_measured_and_simulated(model, closed_loop):
    found = innovant.compare((closed_loop.u, closed_loop.y), model, dt=1.0, names="four")
    axes = found.plot()
    assert axes.shape == (2, 1)
    assert np.array_equal(line(axes[1, 0], "measured"), closed_loop.y[:, 1])
    label = f"four: {found.fit_percent[0, 1]:.1f} %"
    assert np.array_equal(line(axes[1, 0], label), found.simulated["four"][0][:, 1])
    assert legend(axes[1, 0]) == ["measured", label] and axes[1, 0].get_xlabel() == "time [s]"
    axes = found.plot(residuals=True)
    assert axes.shape == (4, 1)
    assert np.array_equal(line(axes[3, 0], "four"), found.residuals("four")[0][:, 1])


def test_an_estimated_plant(fitted):
    u, y = recording(TEXT)
    axes = fitted.plot()
    assert axes.shape == (2, 1)
    assert np.array_equal(line(axes[0, 0], "measured"), y)
    fit = fitted.fit_percent["y"]
    simulated = line(axes[0, 0], f"simulated: {fit:.1f} %")
    assert 100 * (1 - np.std(y - simulated) / np.std(y)) == pytest.approx(fit, abs=0.01)
    assert (axes[0, 0].get_ylabel(), axes[1, 0].get_ylabel()) == ("y [m/s]", "residual [m/s]")
    simulator = innovant.Simulator(lambda u, a: innovant.Plant(TEXT).simulate(u, 0.1, {"a": a}), {"a": (1.0, 0.1, 5.0)})
    by_function = simulator.fit(u, y, dt=0.1).plot()
    assert np.allclose(by_function[0, 0].lines[1].get_ydata(), simulated, atol=0.05)


def test_a_plant_is_judged(fitted):
    u, y = recording(TEXT, seed=8)
    judged = fitted.validate(u, y, dt=0.1)
    assert judged and not judged.rejected and judged.free_run.outputs[0].fit_percent > 95
    assert repr(judged).startswith("innovant.PlantValidation(rejected=False")
    axes = judged.plot()
    assert axes.shape == (3, 1)
    assert np.array_equal(axes[1, 0].lines[0].get_ydata(), y - judged.predicted[0][:, 0])
    wrong = fitted.validate(*recording(DRAG, seed=8), dt=0.1)
    assert wrong.rejected and wrong.findings
    with pytest.raises(innovant.InnovantError, match="recording = 3: there are 1"):
        judged.plot(recording=3)
    with pytest.raises(innovant.InnovantError, match="level = 0.7"):
        fitted.validate(u, y, dt=0.1, level=0.7)


def test_a_linearised_plant(fitted):
    linear = fitted.linearisation(frequencies=[0.1, 1.0, 3.0])
    assert linear["format"] == "innovant-linearisation/1" and isinstance(linear, dict)
    a, b = fitted.parameters["a"], fitted.parameters["b"]
    expected = b / np.abs(1j * np.array([0.1, 1.0, 3.0]) + a)
    axes = linear.plot()
    assert np.allclose(axes[0, 0].lines[0].get_ydata(), expected)
    assert axes[0, 0].collections and axes[0, 0].get_ylabel() == "magnitude [m/s/N]"
    response = linear.response()
    assert np.all(response.magnitude_95[0, 0, :, 0] < expected) and np.all(expected < response.magnitude_95[0, 0, :, 1])
    poles = linear.plot_poles()
    assert line(poles, "poles") == [0.0] and poles.lines[0].get_xdata() == pytest.approx([-a])
    assert poles.get_xlabel() == "real part [rad/s]"
    # A text has no uncertainty.
    assert innovant.Plant(TEXT).linearisation(frequencies=[1.0]).response().covariance is None


def test_an_explanation(explanation, friction):
    axes = explanation.plot()
    assert axes.shape == (2,)
    signals = explanation.to_dict().signals[0]
    assert np.array_equal(line(axes[0], "measured"), signals.recorded)
    assert legend(axes[0]) == ["measured", "simulation", "other parameters only", "with what was found"]
    residual = line(axes[1], "with what was found")
    assert np.allclose(residual, np.array(signals.recorded) - signals.augmented)
    assert np.std(residual) < 0.1 * np.std(line(axes[1], "simulation"))
    with pytest.raises(innovant.InnovantError, match="no signals of output 'y7' of recording 0; there are: 'y1' of recording 0"):
        explanation.plot(output="y7")
    with pytest.raises(innovant.InnovantError, match="this explanation has 0 laws"):
        explanation.plot_law()


def test_the_law_of_an_effect(drag):
    assert drag.verdict == "named" and drag.effects[0].effect == "quadratic_drag"
    (law,) = drag.laws
    axes = drag.plot_law()
    order = np.argsort(law.at)
    assert np.array_equal(axes.lines[0].get_ydata(), np.asarray(law.value)[order])
    # What was left out is -0.3 v |v|.
    at = np.asarray(law.at)
    assert np.allclose(law.value, -0.3 * at * np.abs(at), atol=0.1)
    assert axes.get_xlabel() == "v" and axes.get_ylabel() == "added to the equation of v"
    all_axes = drag.plot()
    assert all_axes.shape == (3,) and all_axes[0].get_ylabel() == "y [m/s]"
    assert "quadratic drag" in all_axes[2].get_title()


def test_an_explained_plant_is_simulated(drag):
    u, _ = recording(DRAG, seed=11)
    truth = innovant.Plant(DRAG).simulate(u, 0.1)[:, 0]
    assert np.std(drag.simulate(u) - truth) < 0.01 * np.std(innovant.Plant(TEXT).simulate(u, 0.1)[:, 0] - truth)
    restored = innovant.Explanation.from_json(drag.to_json())
    assert np.array_equal(restored.simulate(u, dt=0.1), drag.simulate(u))
    with pytest.raises(innovant.InnovantError, match="the sample time is not known"):
        restored.simulate(u)
    with pytest.raises(innovant.InnovantError, match="initial states by name"):
        drag.simulate(u, x0=[1.0])
    with pytest.raises(innovant.InnovantError, match="belong to plants in equations"):
        innovant.explain(u, truth, simulation=truth, dt=0.1, only=["quadratic_drag"])
    asked = innovant.explain(
        u, truth + 0.01 * np.random.default_rng(1).standard_normal(600), simulation=innovant.Plant(TEXT), dt=0.1,
        only=["coulomb_friction"], hypotheses="own: der(v) += -c*v*abs(v), c > 0",
    )
    assert asked.to_dict().hypotheses[0].verdict == "best"


def test_wrong_axes_are_refused(model):
    one = plt.figure().subplots()
    with pytest.raises(innovant.InnovantError, match=r"ax holds 1 Axes; this plot needs 8, 4 x 2: a row of magnitudes"):
        model.plot(ax=one)
    with pytest.raises(innovant.InnovantError, match="ax is str; expected matplotlib Axes"):
        model.poles().plot(ax="here")


def test_matplotlib_is_imported_when_a_plot_is_made(model, monkeypatch):
    original = builtins.__import__

    def without(name, *arguments, **options):
        if name.split(".")[0] == "matplotlib":
            raise ImportError("No module named 'matplotlib'")
        return original(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    for plot in (model.plot, model.poles().plot, model.step_response().plot, lambda: model.plot_bode(backend="matplotlib")):
        with pytest.raises(ImportError, match="pip install matplotlib"):
            plot()


def test_importing_innovant_imports_no_plots():
    import subprocess

    code = (
        "import sys, innovant; u, y, dt = innovant.examples.servo(2000); innovant.identify(u, y, dt=dt, order=3).poles(); "
        "print([name for name in ('matplotlib', 'plotly', 'pandas', 'scipy', 'control', 'dask') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
