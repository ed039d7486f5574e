"""The examples in the docstrings of `outrider.core` are true."""

import doctest
from importlib import import_module

import pytest


@pytest.mark.parametrize("name", ["angles", "attitudes", "frames", "geodesy", "magnetism", "sampling"])
def test_examples(name: str) -> None:
    module = import_module(f"outrider.core.{name}")
    finder = doctest.DocTestFinder(exclude_empty=True)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    for attribute, thing in [("", module), *vars(module).items()]:
        source = getattr(thing, "py_func", thing)  # a compiled kernel keeps its docstring on the Python function
        if getattr(source, "__module__", None) == module.__name__ or source is module:
            for case in finder.find(source, attribute or name, module=module, globs=dict(vars(module))):
                runner.run(case)
    assert runner.summarize(verbose=False).failed == 0
    assert runner.tries > 0
