"""The examples run, and say what they promise."""

import contextlib
import io
import json
import runpy
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np


EXAMPLES = Path(__file__).parent.parent / "examples"


def run(name, capsys, *arguments, monkeypatch):
    monkeypatch.setattr("sys.argv", [name, *map(str, arguments)])
    # Not as __main__: the workers of a cluster would run it again.
    result = runpy.run_path(str(EXAMPLES / name), run_name="example")["main"]()
    return result, capsys.readouterr().out


def test_servo_in_closed_loop(capsys, monkeypatch, tmp_path):
    page = tmp_path / "bode.html"
    (model, hertz, std, fresh), said = run("servo_in_closed_loop.py", capsys, page, monkeypatch=monkeypatch)
    assert model.output_labels == ["speed"]
    assert abs(hertz - 18.0) < 4 * std and std < 0.5
    assert not fresh.rejected and "agrees with the model" in said
    assert page.stat().st_size > 1_000_000


def test_simulation_without_friction(capsys, monkeypatch, tmp_path):
    page = tmp_path / "page.html"
    (found, before, after), said = run("simulation_without_friction.py", capsys, page, monkeypatch=monkeypatch)
    assert found.effects[0].effect == "coulomb_friction"
    assert after < 0.1 * before
    assert said.startswith("NAMED") and page.exists()


def test_fleet_on_dask(capsys, monkeypatch):
    (together, alone, difference), said = run("fleet_on_dask.py", capsys, monkeypatch=monkeypatch)
    assert difference < 1e-10
    assert together.poles().natural_frequency_std[0] < 0.6 * alone.poles().natural_frequency_std[0]
    assert "the fleet" in said


def test_external_simulator(capsys, monkeypatch, tmp_path):
    fitted, said = run("external_simulator.py", capsys, tmp_path, monkeypatch=monkeypatch)
    for name, truth in [("k", 0.05), ("a", 0.1), ("h0", 1.3)]:
        assert abs(fitted.estimates[name].value - truth) < 4 * fitted.estimates[name].std
    # The same file is the simulator of the command line.
    (tmp_path / "values.json").write_text(json.dumps(fitted.parameters))
    files = [tmp_path / "log.csv", tmp_path / "out.csv", tmp_path / "values.json"]
    subprocess.run([sys.executable, EXAMPLES / "external_simulator.py", *files], check=True)
    table = np.loadtxt(tmp_path / "out.csv", delimiter=",", skiprows=1)
    u = np.loadtxt(tmp_path / "log.csv", delimiter=",", skiprows=1)[:, 1]
    np.testing.assert_allclose(table[:, 1], fitted.simulate(u)[:, 0], rtol=1e-9)
    assert "--simulator-parameters" in said


def test_every_example_is_tested():
    assert sorted(p.name for p in EXAMPLES.glob("*.py")) == [
        "external_simulator.py",
        "fleet_on_dask.py",
        "servo_in_closed_loop.py",
        "simulation_without_friction.py",
    ]


def test_the_readme_tells_the_truth(monkeypatch, tmp_path):
    """The Python of README.md prints what stands below it; each example goes on where the one before ended."""
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    text = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
    parts = text.split("<!-- example -->\n```python\n")[1:]
    assert len(parts) == 2
    names = {}
    for part in parts:
        code = part.split("```")[0]
        printed = part.split("<!-- output -->\n```text\n")[1].split("```")[0]
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(compile(code, "README.md", "exec"), names)
        assert out.getvalue() == printed
    assert (tmp_path / "comparison.png").stat().st_size > 10_000


def test_types_are_stubbed():
    import innovant

    folder = Path(innovant.__file__).parent
    assert (folder / "py.typed").exists() and (folder / "_innovant.pyi").exists()
    stub = (folder / "_innovant.pyi").read_text()
    from innovant import _innovant

    for name in dir(_innovant):
        if not name.startswith("__") or name == "__version__":
            assert name in stub, name
            for method in dir(getattr(_innovant, name)):
                if not method.startswith("_") and isinstance(getattr(_innovant, name), type):
                    if method in vars(getattr(_innovant, name)):
                        assert f"def {method}(" in stub, f"{name}.{method}"
