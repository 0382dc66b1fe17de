"""Every example in the documentation runs."""

import doctest
import importlib
import pkgutil

import pytest

import innovant

MODULES = sorted(m.name for m in pkgutil.iter_modules(innovant.__path__) if not m.name.startswith("_"))


@pytest.mark.parametrize("name", ["", *MODULES])
def test_examples(name):
    module = importlib.import_module(f"innovant.{name}") if name else innovant
    result = doctest.testmod(module)
    assert result.failed == 0


def test_there_are_examples():
    finder = doctest.DocTestFinder()
    modules = [innovant, *(importlib.import_module(f"innovant.{name}") for name in MODULES)]
    examples = {test.name for module in modules for test in finder.find(module) if test.examples}
    for name in ("identification.identify", "explanation.explain", "model.Model.simulate", "dask.identify", "comparison.compare"):
        assert f"innovant.{name}" in examples
