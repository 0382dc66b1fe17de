"""How the package is made: modules that import each other in one direction, and stubs that agree with the native part."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import innovant

FOLDER = Path(innovant.__file__).parent


def imports(path):
    """Modules of the package that a module imports: also in functions, and for type checkers only."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level == 1:
            found |= {node.module.split(".")[0]} if node.module else {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("innovant"):
            found |= {node.module.removeprefix("innovant").removeprefix(".").split(".")[0] or "__init__"}
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names if alias.name.split(".")[0] == "innovant"]
            found |= {name.removeprefix("innovant").removeprefix(".") or "__init__" for name in names}
    return found


def circle(graph):
    """A list of modules that import each other in a circle; none if there is none."""
    done = set()

    def visit(name, path):
        if name in path:
            return [*path[path.index(name) :], name]
        if name in done:
            return None
        for other in sorted(graph.get(name, ())):
            found = visit(other, [*path, name])
            if found:
                return found
        done.add(name)
        return None

    return next(filter(None, (visit(name, []) for name in sorted(graph))), None)


def test_modules_import_each_other_in_one_direction():
    graph = {path.stem: imports(path) for path in FOLDER.glob("*.py")}
    assert {"frames", "plots", "model"} <= graph["comparison"] and "_innovant" in graph["frames"]
    assert circle(graph) is None


def test_a_circle_would_be_found():
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}}) == ["a", "b", "c", "a"]
    assert circle({"a": {"b", "c"}, "b": {"c"}}) is None


def test_the_stub_agrees_with_the_native_part(tmp_path):
    pytest.importorskip("mypy")
    # Not in the folder of the sources: what is checked is what is installed.
    command = [sys.executable, "-m", "mypy.stubtest", "innovant._innovant"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_function_has_types():
    """Arguments and results of the Python files have annotations, which `py.typed` promises."""
    missing = []
    for path in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                arguments += [one for one in (node.args.vararg, node.args.kwarg) if one is not None]
                bare = [one.arg for one in arguments if one.annotation is None and one.arg not in ("self", "cls")]
                if bare or node.returns is None:
                    missing.append((path.name, node.name, bare))
    assert missing == []


def test_everything_public_is_documented():
    for name in innovant.__all__:
        if not name.startswith("__"):
            assert getattr(innovant, name).__doc__, name
