"""What a compiled kernel is kept for: exactly the sources that it was made of."""

import inspect
import pkgutil
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import outrider
from outrider import _sources
from outrider._kernel import Kernel

FILES = {
    "a.py": "from outrider.b import (\n    one,  # of b\n    two,\n)\n",
    "b.py": "def f():\n    from outrider import c\n",
    "c.py": "LIMIT = 3\n",
    "d.py": "import outrider.e.g\n",
    "e/__init__.py": "from outrider.e.h import x\n",
    "e/g.py": "",
    "e/h.py": "",
}


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(_sources, "PACKAGE", tmp_path)
    forget()
    yield tmp_path
    forget()


def forget() -> None:
    for cached in (_sources._read, _sources._file, _sources.package_stamp):
        cached.cache_clear()


@pytest.mark.parametrize(
    ("changed", "stale"), [("a.py", "a"), ("b.py", "ab"), ("c.py", "abc"), ("e/g.py", "d"), ("e/__init__.py", "")]
)
def test_a_change_reaches_those_that_import_it(package: Path, changed: str, stale: str) -> None:
    before = {name: _sources.stamp(package / f"{name}.py") for name in "abcd"}
    (package / changed).write_text(FILES[changed] + "# changed\n")
    forget()
    assert {name for name in before if _sources.stamp(package / f"{name}.py") != before[name]} == set(stale)


def test_time_of_change_and_place_do_not_matter_but_what_was_told_does(package: Path) -> None:
    before = _sources.stamp(package / "a.py")
    (package / "c.py").touch()
    forget()
    assert _sources.stamp(package / "a.py") == before != _sources.stamp(package / "a.py", "another compiler")


@pytest.mark.compiled
def test_no_kernel_calls_what_it_is_not_stamped_by() -> None:
    checked = 0
    for module in pkgutil.walk_packages(outrider.__path__, "outrider."):
        if module.name.split(".")[1] in ("cli", "__main__"):
            continue
        for made in vars(import_module(module.name)).values():
            if not isinstance(made, Kernel) or made.py_func.__module__ != module.name:
                continue
            stands_on = _sources._closure(Path(inspect.getfile(made.py_func)))
            for name in made.py_func.__code__.co_names:
                called = made.py_func.__globals__.get(name)
                if isinstance(called, Kernel):
                    assert Path(inspect.getfile(called.py_func)) in stands_on, f"{made.py_func.__name__} calls {name}"
                    checked += 1
    assert checked > 100
