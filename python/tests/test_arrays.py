"""Arrays and frames: messages that name the argument and its shape, and sample times out of an index."""

import numpy as np
import pandas
import polars
import pytest

import innovant
from innovant import frames

DT = 0.25


@pytest.fixture(scope="module")
def servo():
    u, y, _ = innovant.examples.servo(1000)
    return u, y


def same_model(found, servo, dt=DT):
    expected = innovant.identify(*servo, dt=dt, order=3)
    assert found.dt == pytest.approx(dt, rel=1e-9)
    assert np.array_equal(found.A, expected.A)


def frame(servo, index):
    return pandas.DataFrame({"u": servo[0][:, 0], "y": servo[1][:, 0]}, index=index)


INDICES = {
    "dates": pandas.date_range("2026-01-01", periods=1000, freq="250ms"),
    "dates with a zone": pandas.date_range("2026-01-01", periods=1000, freq="250ms", tz="Europe/Vienna"),
    "durations": pandas.timedelta_range("5s", periods=1000, freq="250ms"),
    "seconds": pandas.Index(3.0 + DT * np.arange(1000)),
}


@pytest.mark.parametrize("kind", INDICES)
def test_a_time_index_gives_the_sample_time(servo, kind):
    data = frame(servo, INDICES[kind])
    same_model(innovant.identify(data, order=3), servo)
    # Frames and series of inputs and outputs, and a plain array beside one of them.
    same_model(innovant.identify(data[["u"]], data[["y"]], order=3), servo)
    same_model(innovant.identify(data["u"], data["y"], order=3), servo)
    same_model(innovant.identify(servo[0], data["y"], order=3), servo)
    # The same number may be passed too.
    same_model(innovant.identify(data, order=3, dt=DT), servo)
    with pytest.raises(innovant.InnovantError, match=r"dt = 0\.3 s was passed, and the index of the frame gives dt = 0\.25 s"):
        innovant.identify(data, order=3, dt=0.3)
    with pytest.raises(innovant.InnovantError, match=r"dt = 0\.3 s was passed, and the index of u gives dt = 0\.25 s"):
        innovant.identify(data["u"], data["y"], order=3, dt=0.3)


def test_an_index_without_equal_steps_gives_none(servo):
    stamps = 3.0 + DT * np.arange(1000)
    stamps[400:] += 0.1
    data = frame(servo, pandas.Index(stamps))
    with pytest.raises(innovant.InnovantError, match=r"the index of the frame gives no sample time, and dt= was not passed"):
        innovant.identify(data, order=3)
    with pytest.raises(innovant.InnovantError, match=r"the index of u gives no sample time"):
        innovant.identify(data["u"], data["y"], order=3)
    same_model(innovant.identify(data, order=3, dt=DT), servo)


def test_an_index_that_is_no_time_gives_none(servo):
    for index in (pandas.RangeIndex(1000), pandas.Index([f"row {k}" for k in range(1000)])):
        with pytest.raises(innovant.InnovantError, match="dt|time"):
            innovant.identify(frame(servo, index), order=3)
        same_model(innovant.identify(frame(servo, index), order=3, dt=DT), servo)
    data = frame(servo, pandas.RangeIndex(1000))
    with pytest.raises(innovant.InnovantError, match=r"the sample time is not known: pass dt= \(seconds\)"):
        innovant.identify(data["u"], data["y"], order=3)


def test_a_column_of_time_and_a_number_must_agree(servo):
    data = frame(servo, None).assign(t=DT * np.arange(1000))
    same_model(innovant.identify(data, order=3), servo)
    same_model(innovant.identify(data, order=3, dt=DT), servo)
    with pytest.raises(innovant.InnovantError, match=r"dt = 0\.5 s was passed, and the column `t` gives dt = 0\.25 s"):
        innovant.identify(data, order=3, dt=0.5)
    stamped = polars.from_pandas(frame(servo, None)).with_columns(
        polars.Series("time", pandas.date_range("2026-01-01", periods=1000, freq="250ms").to_numpy())
    )
    same_model(innovant.identify(stamped, order=3), servo)


def test_indices_of_inputs_and_outputs_must_agree(servo):
    u = pandas.Series(servo[0][:, 0], index=INDICES["seconds"])
    other = pandas.Series(servo[1][:, 0], index=pandas.Index(3.0 + 0.5 * np.arange(1000)))
    with pytest.raises(innovant.InnovantError, match=r"the index of u gives dt = 0\.25 s, and the index of y gives dt = 0\.5 s"):
        innovant.identify(u, other, order=3)
    late = pandas.Series(servo[1][:, 0], index=INDICES["seconds"] + 1.0)
    with pytest.raises(innovant.InnovantError, match=r"the index of y begins 1 s after the index of u"):
        innovant.identify(u, late, order=3)


def test_a_model_and_the_index_of_new_data_must_agree(servo):
    data = frame(servo, INDICES["dates"])
    named = innovant.identify(data, order=3)
    assert list(named.simulate(data).columns) == ["y"]
    slow = frame(servo, pandas.date_range("2026-01-01", periods=1000, freq="1s"))
    for wrong in (
        lambda: named.simulate(slow),
        lambda: named.predict(slow),
        lambda: named.validate(slow),
        lambda: named.initial_state(slow),
        lambda: named.simulate(slow["u"]),
    ):
        with pytest.raises(innovant.InnovantError, match=r"gives dt = 1 s, and the model has dt = 0\.25 s"):
            wrong()


def test_plants_and_simulators_take_an_index_too(servo):
    plant = innovant.Plant(
        "model Lag\n input Real u; output Real y; Real x(start=0);\n parameter Real T(min=0.1, max=10) = 1;\n"
        "equation\n T*der(x) = u - x; y = x;\nend Lag;"
    )
    u = pandas.DataFrame({"other": 0.0, "u": np.repeat([1.0, -1.0, 2.0, 0.0], 50)}, index=INDICES["seconds"][:200])
    expected = plant.simulate(u["u"].to_numpy(), DT)
    assert np.array_equal(plant.simulate(u), expected)
    data = u.assign(y=expected[:, 0] + 0.01 * np.random.default_rng(1).standard_normal(200))
    fitted = plant.fit(data)
    by_arrays = plant.fit(data["u"].to_numpy(), data["y"].to_numpy(), DT)
    assert fitted.parameters == by_arrays.parameters
    with pytest.raises(innovant.InnovantError, match=r"dt = 1 s was passed, and the index of u gives dt = 0\.25 s"):
        plant.simulate(u, 1.0)
    with pytest.raises(innovant.InnovantError, match="the sample time is not known"):
        plant.simulate(u["u"].to_numpy())

    def lag(u, T):
        return plant.simulate(u, DT, parameters={"T": T})

    simulator = innovant.Simulator(lag, {"T": (2.0, 0.1, 10.0)}, outputs=["y"], inputs=["u"])
    assert simulator.fit(data).parameters["T"] == pytest.approx(fitted.parameters["T"], rel=1e-3)


WIDE = np.zeros((3, 5000))
TALL = np.zeros((5000, 3))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda m: innovant.identify(WIDE, TALL, dt=1.0), r"u has the shape \(3, 5000\): 3 samples of 5000 channels: transposed\?"),
        (lambda m: innovant.identify(TALL, WIDE, dt=1.0), r"y has the shape \(3, 5000\): .*pass y\.T"),
        (lambda m: innovant.identify([TALL, WIDE], [TALL, TALL], dt=1.0), r"u\[1\] has the shape \(3, 5000\)"),
        (lambda m: innovant.identify(TALL, TALL[:, 0, None, None], dt=1.0), r"y has the shape \(5000, 1, 1\), 3 dimensions"),
        (lambda m: innovant.identify(TALL, np.float64(3.0), dt=1.0), r"y has the shape \(\), 0 dimensions"),
        (lambda m: innovant.identify(TALL[:7], TALL, dt=1.0), r"u has the shape \(7, 3\) and y the shape \(5000, 3\): 7 and 5000"),
        (lambda m: innovant.identify(TALL, TALL, dt="soon"), r"dt = 'soon': expected the sample time in seconds"),
        (lambda m: innovant.identify(TALL, TALL, dt=1.0, inputs="a"), r"inputs= names 1 channels \(a\), but the array has 3"),
        (lambda m: m.simulate(np.zeros((2, 5000))), r"u .*2 samples of 5000 channels: transposed\? Expected samples x 2 \(u1, u2\)"),
        (lambda m: m.simulate(TALL), r"u has the shape \(5000, 3\), 3 channels; expected samples x 2 \(u1, u2\)"),
        (lambda m: m.simulate(TALL[:, 0]), r"u has the shape \(5000,\), 1 channel; expected samples x 2"),
        (lambda m: m.simulate(TALL[:, :2], x0=[1.0]), r"x0 has the shape \(1,\); expected 4 numbers, one for each state"),
        (lambda m: m.simulate(TALL[:, :2], x0=["a"] * 4), r"x0 cannot be read as numbers"),
        (lambda m: m.predict(TALL[:, :2], TALL[:9, :2]), r"u has the shape \(5000, 2\) and y the shape \(9, 2\)"),
        (lambda m: m.predict(TALL[:, :2]), r"y is missing"),
        (lambda m: m.validate(TALL[:, :2], TALL[:, :2].T), r"y .*transposed\?.*\(y1, y2\)"),
        (lambda m: m.frequency_response([[1.0, 2.0]]), r"omega has the shape \(1, 2\)"),
        (lambda m: m.frequency_response("fast"), r"omega cannot be read as numbers"),
        (lambda m: innovant.Model([["a"]], [[1.0]], [[1.0]], dt=1.0), r"A cannot be read as numbers"),
        (
            lambda m: innovant.explain(TALL[:, 0], TALL[:, 0], simulation=TALL, dt=1.0),
            r"simulation has the shape \(5000, 3\), 3 channels; expected samples x 1 \(y1\)",
        ),
        (lambda m: innovant.Moments(TALL, TALL[:9], dt=1.0), r"u has the shape \(5000, 3\) and y the shape \(9, 3\)"),
    ],
)
def test_messages_name_the_argument_and_its_shape(model, call, words):
    with pytest.raises(innovant.InnovantError, match=words):
        call(model)


def test_chunks_may_have_few_samples():
    """A chunk of a recording may be shorter than it is wide; a recording may not."""
    assert frames.samples(np.zeros((2, 3)), "u", few=True).shape == (2, 3)
    with pytest.raises(innovant.InnovantError, match="transposed"):
        frames.samples(np.zeros((2, 3)), "u")
    assert frames.samples(np.zeros((1, 3)), "u", ["a", "b", "c"]).shape == (1, 3)
