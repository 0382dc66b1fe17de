"""Simulators of one's own from Python."""

import math

import numpy as np
import pytest

import innovant

TEXT = """model Lag
  parameter Real T(unit="s", min=0.1, max=10) = 1;
  parameter Real g(min=0.1, max=10) = 1.5;
  input Real u; output Real y; Real x(start=0, fixed=true);
equation
  T*der(x) = g*u - x; y = x;
end Lag;"""
PARAMETERS = {"T": (1.0, 0.1, 10.0), "g": (1.5, 0.1, 10.0)}


def lag(u, T, g):
    y, decay = np.zeros(len(u)), math.exp(-0.1 / T)
    for k in range(1, len(u)):
        y[k] = decay * y[k - 1] + (1 - decay) * g * u[k - 1]
    return y


def recording(samples=600, seed=1):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.standard_normal(samples // 10), 10)
    return u, lag(u, T=0.7, g=2.0) + 0.02 * rng.standard_normal(samples)


def test_a_function_is_estimated_as_its_equations_are():
    u, y = recording()
    seen = []

    def counted(u, **values):
        seen.append(tuple(values.values()))
        return lag(u, **values)

    of_function = innovant.Simulator(counted, PARAMETERS).fit(u, y, dt=0.1)
    of_equations = innovant.Plant(TEXT).fit(u, y, dt=0.1, form="free run")
    for name, truth in [("T", 0.7), ("g", 2.0)]:
        a, b = of_function.estimates[name], of_equations.estimates[name]
        assert abs(a.value - truth) < 4 * a.std
        assert abs(a.value - b.value) < 0.05 * b.std
        assert abs(a.std / b.std - 1) < 0.02
    assert len(seen) == len(set(seen)) == of_function.document["simulator"]["runs"]
    assert of_function.undetermined == []
    assert isinstance(of_function, innovant.Estimate) and isinstance(of_equations, innovant.Estimate)
    assert str(of_function).startswith("counted from 600 samples")
    np.testing.assert_allclose(of_function.simulate(u)[:, 0], lag(u, **of_function.parameters))


def test_several_recordings_inputs_and_outputs(tmp_path):
    def two(u, T, g):
        return np.column_stack([lag(u[:, 0], T, g), lag(u[:, 1], T, 1.0)])

    rng = np.random.default_rng(2)
    us = [np.repeat(rng.standard_normal((40, 2)), 10, axis=0) for _ in range(2)]
    ys = [two(u, 0.7, 2.0) + 0.02 * rng.standard_normal((400, 2)) for u in us]
    fitted = innovant.Simulator(two, PARAMETERS, outputs=["a", "b"], inputs=["p", "q"]).fit(us, ys, dt=0.1, fix="g")
    assert list(fitted.estimates) == ["T"] and fitted.parameters["g"] == 1.5
    assert [f["output"] for f in fitted.document["fit"]] == ["a", "b"]
    fitted.save(tmp_path / "fit.json")
    with pytest.raises(innovant.InnovantError, match="holds no equations"):
        innovant.Plant(tmp_path / "fit.json")


def test_what_the_function_raises_is_raised():
    u, y = recording()

    def broken(u, T, g):
        raise KeyError("no such table")

    with pytest.raises(KeyError, match="no such table") as caught:
        innovant.Simulator(broken, PARAMETERS).fit(u, y, dt=0.1)
    assert caught.traceback[-1].name == "broken"


def test_values_that_give_nan_are_not_taken():
    u, y = recording()

    def fragile(u, T, g):
        return lag(u, T, g) if T < 1.2 else np.full(len(u), np.nan)

    fitted = innovant.Simulator(fragile, PARAMETERS).fit(u, y, dt=0.1)
    assert abs(fitted.estimates["T"].value - 0.7) < 4 * fitted.estimates["T"].std


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda u, y: innovant.Simulator(lambda u, T: u[:-1], {"T": 1}).fit(u, y, dt=0.1), r"\(599,\); expected is \(600,\)"),
        (
            lambda u, y: innovant.Simulator(lambda u, T: u, {"T": 1}, ["a", "b"]).fit(u, np.ones((600, 2)), dt=0.1),
            r"expected is \(600, 2\)",
        ),
        (lambda u, y: innovant.Simulator(lag, {"T": (1, 2, 3), "g": 1}), "T: the value 1.0 is not between"),
        (lambda u, y: innovant.Simulator(lag, {"T": (1, 2)}), r"\(value, min, max\)"),
        (lambda u, y: innovant.Simulator("lag", {"T": 1}), "not a function"),
        (lambda u, y: innovant.Simulator(lag, PARAMETERS).fit(u, y, dt=0.1, fix=["q"]), "no parameter `q`"),
        (lambda u, y: innovant.Simulator(lambda u, T, g: u * np.nan, PARAMETERS).fit(u, y, dt=0.1), "NaN in row 1"),
    ],
)
def test_errors_say_what_to_do(make, words):
    with pytest.raises(innovant.InnovantError, match=words):
        make(*recording())
