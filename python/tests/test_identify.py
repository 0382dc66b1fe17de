"""The wheel gives what the core gives, whatever the data come in."""

import json

import numpy as np
import pandas
import polars
import pytest

import innovant


def test_poles_are_found_in_closed_loop(model):
    assert model.order == model.nstates == 4
    assert (model.ninputs, model.noutputs, model.dt) == (2, 2, 1.0)
    for true in (0.67 + 0.67j, -0.67 + 0.67j):
        assert np.min(np.abs(np.linalg.eigvals(model.A) - true)) < 0.05
    assert model.covariance.shape == (40, 40)
    assert np.linalg.eigvalsh(model.covariance).min() > -1e-12
    assert np.linalg.eigvalsh(model.innovation_covariance).min() > 0.5
    assert "residuals are white" in model.verdict
    assert model.residual_tests.rejected is False
    assert model.residual_tests.feedback.p_value < 1e-6


def variants(u, y):
    """The same numbers, handed in differently."""
    wide = np.zeros((2 * len(u), 5))
    wide[::2, 1:3] = u
    frame = pandas.DataFrame(np.hstack([u, y]), columns=["u1", "u2", "y1", "y2"])
    return {
        "fortran order": (np.asfortranarray(u), np.asfortranarray(y)),
        "not contiguous": (wide[::2, 1:3], y[::-1][::-1]),
        "lists of lists": (u.tolist(), y.tolist()),
        "other byte order": (u.astype(">f8"), y),
        "pandas": (frame, None),
        "two frames": (frame[["u1", "u2"]], frame[["y1", "y2"]]),
        "polars": (polars.from_numpy(frame.to_numpy(), schema=list(frame.columns)), None),
    }


def test_layout_and_container_do_not_matter(closed_loop):
    u, y = closed_loop.u, closed_loop.y
    expected = innovant.identify(u, y, dt=1.0, order=4)
    for name, (first, second) in variants(u, y).items():
        found = innovant.identify(first, second, dt=1.0, order=4)
        assert np.array_equal(found.A, expected.A), name
        assert np.array_equal(found.covariance, expected.covariance), name
        assert found.output_labels == ["y1", "y2"], name


def test_inputs_are_not_modified(closed_loop):
    u, y = closed_loop.u.copy(), closed_loop.y.astype(np.float32)
    before = u.copy(), y.copy()
    innovant.identify(u, y, dt=1.0, order=4)
    assert np.array_equal(u, before[0]) and np.array_equal(y, before[1])
    assert y.dtype == np.float32


def test_small_numbers_of_other_kinds(closed_loop):
    y = np.round(100 * closed_loop.y[:, 0])
    as_float = innovant.identify(closed_loop.u[:, 0], y, dt=1.0, order=2)
    as_integer = innovant.identify(closed_loop.u[:, 0], y.astype(np.int32), dt=1.0, order=2)
    assert np.array_equal(as_float.A, as_integer.A)


def test_several_experiments(closed_loop):
    other = innovant.examples.closed_loop(1500, seed=2)
    both = innovant.identify([closed_loop.u, other[0]], [closed_loop.y, other[1]], dt=1.0, order=4)
    document = json.loads(both.to_json())
    assert document["samples"] == 3500
    assert [r["name"] for r in document["provenance"]["recordings"]] == ["recording 1", "recording 2"]
    # More data, less uncertainty.
    one = innovant.identify(closed_loop.u, closed_loop.y, dt=1.0, order=4)
    assert both.poles().natural_frequency_std.sum() < one.poles().natural_frequency_std.sum()


def test_frames_name_their_columns(closed_loop):
    frame = pandas.DataFrame(
        {
            "t [ms]": 1000.0 * np.arange(2000),
            "temperature": 20.0,
            "position [m]": closed_loop.y[:, 0],
            "force [N]": closed_loop.u[:, 0],
            "torque": closed_loop.u[:, 1],
        }
    )
    model = innovant.identify(frame, inputs=["force", "torque"], outputs="position", order=4)
    assert model.dt == 1.0
    assert (model.input_labels, model.output_labels) == (["force", "torque"], ["position"])
    assert json.loads(model.to_json())["inputs"][0]["unit"] == "N"
    dated = frame.drop(columns="t [ms]").set_index(pandas.date_range("2026-01-01", periods=2000, freq="1s"))
    assert innovant.identify(dated, inputs=["force", "torque"], outputs="position", order=4).dt == 1.0
    simulated = model.simulate(frame)
    assert list(simulated.columns) == ["position [m]"] and len(simulated) == 2000
    assert isinstance(model.predict(polars.from_pandas(frame)), polars.DataFrame)
    with pytest.raises(innovant.InnovantError, match="did you mean `torque`?"):
        innovant.identify(frame, inputs=["torqe"], outputs="position")


def test_options_reach_the_core(closed_loop):
    u, y = closed_loop.u, closed_loop.y
    asked = innovant.identify(
        u, y, dt=1.0, order=np.int64(4), past=12, future=8, polish="never", weight="cva", detrend="none", delay=[0, 0]
    )
    document = json.loads(asked.to_json())
    assert document["horizons"] == {"past": 12, "future": 8}
    assert document["weight"] == "cva" and document["polished"] is False
    assert document["options"]["detrend"] == "none"
    assert innovant.identify(u, y, dt=1.0, order=range(3, 6)).order == 4
    robust = innovant.identify(u, y, dt=1.0, order=4, past=10, covariance="robust")
    assert json.loads(robust.to_json())["diagnostics"]["jackknife_blocks"] >= 20
    whitening = innovant.identify(u, y, dt=1.0, order=4, method="whitening")
    assert json.loads(whitening.to_json())["method"] == "whitening"
    delayed = innovant.identify(u[:-2], y[2:], dt=1.0, order=4)
    known = innovant.identify(u, y, dt=1.0, order=4, delay=2)
    assert known.input_delays == [2, 2] and delayed.input_delays == [0, 0]


def test_errors_are_exceptions_with_the_words_of_the_command_line(closed_loop):
    u, y = closed_loop.u.copy(), closed_loop.y.copy()
    u[:, 1] = 3.0
    for wrong, words in [
        (lambda: innovant.identify(u, y, dt=1.0), "'u2' is constant: it carries no information"),
        (lambda: innovant.identify(y, y, dt=1.0), "are the same signal"),
        (lambda: innovant.identify(closed_loop.u, y, dt=1.0, polish="perhaps"), "polish"),
        (lambda: innovant.identify(closed_loop.u, y, dt=1.0, order=0), "at least one state"),
        (lambda: innovant.identify(closed_loop.u, y, dt=1.0, order="four"), "order"),
        (lambda: innovant.identify(closed_loop.u, y, dt=1.0, past=5, future=9), "future window cannot be longer"),
        (lambda: innovant.identify(closed_loop.u, y, dt=0.0), "sample time"),
        (lambda: innovant.identify(closed_loop.u, y), "dt="),
        (lambda: innovant.identify(closed_loop.u, dt=1.0), "y is missing"),
        (lambda: innovant.identify(closed_loop.u[:50], y, dt=1.0), "50"),
        (lambda: innovant.identify(closed_loop.u[:9], y[:9], dt=1.0), "too short"),
        (lambda: innovant.identify([], [], dt=1.0), "at least 1"),
        (lambda: innovant.identify(closed_loop.u[:, :, None], y, dt=1.0), "3 dimensions"),
        (lambda: innovant.identify(closed_loop.u + 1j, y, dt=1.0), "complex"),
        (lambda: innovant.identify([["a"], ["b"]], y, dt=1.0), "cannot be read as numbers"),
        (lambda: innovant.identify(closed_loop.u, y, dt=1.0, delay=[1, 2, 3]), "--delay has 3 values"),
        (lambda: innovant.identify([closed_loop.u], [y, y], dt=1.0), "1 experiments in u and 2 in y"),
    ]:
        with pytest.raises(innovant.InnovantError, match=words):
            wrong()
    assert issubclass(innovant.InnovantError, ValueError)


def test_numbers_that_are_none_are_named(closed_loop):
    y = closed_loop.y.copy()
    y[17, 1] = np.nan
    with pytest.raises(innovant.InnovantError, match="y2.*17.*NaN"):
        innovant.identify(closed_loop.u, y, dt=1.0)
    masked = np.ma.masked_invalid(y)
    with pytest.raises(innovant.InnovantError, match="y2.*17.*NaN"):
        innovant.identify(closed_loop.u, masked, dt=1.0)
    frame = pandas.DataFrame({"u": closed_loop.u[:, 0], "y": pandas.array([None] + [1.5] * 1999, dtype="Float64")})
    with pytest.raises(innovant.InnovantError, match="y.*0.*NaN"):
        innovant.identify(frame, dt=1.0)


def test_the_gil_is_released():
    """Another thread goes on while a model is made."""
    import threading
    import time

    u, y, dt = innovant.examples.closed_loop(1_000_000)
    done, longest = threading.Event(), 0.0

    def work():
        innovant.identify(u, y, dt=dt)
        done.set()

    thread = threading.Thread(target=work)
    started = before = time.perf_counter()
    thread.start()
    ticks = 0
    while not done.is_set():
        time.sleep(0.001)
        now = time.perf_counter()
        longest, before, ticks = max(longest, now - before), now, ticks + 1
    thread.join()
    # Copying the arrays holds it; the rest, most of the time, does not.
    assert ticks > 5 and longest < 0.8 * (time.perf_counter() - started)
