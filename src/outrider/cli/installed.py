"""`outrider doctor --self`: whether this installation can do its work, and what it could do beyond."""

import os
import platform
import re
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from outrider import __version__
from outrider._sources import PACKAGE, stamp
from outrider.cli.shared import print_json
from outrider.errors import ExitCode

SCHEMA = "outrider.installation/1"
# Optional extras: a module of each, and what it is for.
EXTRAS = {
    "dask": ("distributed", "campaigns on a cluster"),
    "ompl": ("ompl", "RRT*, for comparison"),
    "physics": ("mujoco", "a second physics, films"),
    "trees": ("py_trees", "behaviour trees around missions"),
}
Check = dict[str, Any]


def check_installation(*, json: bool) -> int:
    """Print what there is; the exit code is 1 if something that every run needs is amiss."""
    checks = list(_checks())
    code = ExitCode.OK if all(c["ok"] or c["optional"] for c in checks) else ExitCode.FAILED_CHECK
    if json:
        return print_json({"schema": SCHEMA, "checks": checks}, code)
    from rich.text import Text

    from outrider.cli.render import console

    out = console()
    for c in checks:
        mark, colour = ("ok", "green") if c["ok"] else ("-", "dim") if c["optional"] else ("!!", "bold red")
        out.print(Text.assemble((f"{mark:<3}", colour), f"{c['what']:<22}", c["found"]))
        if c["fix"]:
            out.print(Text(f"   {'':<22}{c['fix']}", "dim"))
    return code


def _checks() -> Iterator[Check]:
    machine = f"{platform.python_version()} on {platform.system()} {platform.machine()}, {_cores()} cores"
    yield _check("python", f"{machine}: {sys.executable}", ok=sys.version_info >= (3, 11), fix="Python 3.11 or later")
    yield _check("outrider", f"{__version__}: {Path(__file__).resolve().parents[1]}")
    missing = [name for name in _needed() if _version(name) is None]
    yield _check(
        "packages", f"missing: {', '.join(missing)}" if missing else "all that are needed", ok=not missing,
        fix="pip install outrider" if missing else "",
    )  # fmt: skip
    from outrider import _kernel  # imports the compiler

    fault = _kernel.cache_fault()
    folder = os.environ.get("OUTRIDER_CACHE") or "~/.cache/outrider"
    yield _check(
        "compiled kernels", fault or f"can be kept in {folder}", ok=not fault,
        fix="every run compiles for a minute: OUTRIDER_CACHE names a folder that can be written" if fault else "",
    )  # fmt: skip
    there, of, size = kept_kernels()
    missing_some = (
        "" if there == of else ", a run compiles what it misses" if there else ", a run compiles for a minute"
    )
    yield _check(
        "compiled so far", f"{there} of {of} files{missing_some}; {size / 1e6:.0f} MB, older versions included"
    )
    for extra, (module, about) in EXTRAS.items():
        there = find_spec(module) is not None
        found = f"{about}: {_version(module) or 'installed'}" if there else f"{about}: not installed"
        yield _check(
            f"extra {extra}", found, ok=there, optional=True, fix="" if there else f"pip install 'outrider[{extra}]'"
        )


def kept_kernels() -> tuple[int, int, int]:
    """Source files whose kernels an earlier run has left on the disk, those that have kernels, bytes on the disk."""
    from outrider import _kernel  # imports the compiler

    mine = re.compile(rb"^from outrider\._kernel import (?:kernel|inlined)", re.M)
    ours = [p for p in PACKAGE.rglob("*.py") if mine.search(p.read_bytes())]
    folder = _kernel._kept_in()
    if folder is None:
        return 0, len(ours), 0
    there = {stamp(p, _kernel._TOLD) for p in ours} & {p.name for p in folder.glob("*/*") if p.is_dir()}
    return len(there), len(ours), sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())


def _check(what: str, found: str, *, ok: bool = True, optional: bool = False, fix: str = "") -> Check:
    return {"what": what, "found": found, "ok": ok, "optional": optional, "fix": "" if ok else fix}


def _needed() -> list[str]:
    """Names of the packages that outrider cannot do without."""
    told = requires("outrider") or []
    bare = [line.split(";")[0] for line in told if "extra ==" not in line]
    return [next(w for w in _words(line)) for line in bare]


def _words(line: str) -> Iterator[str]:
    for end, letter in enumerate(line):
        if not (letter.isalnum() or letter in "-_."):
            yield line[:end]
            return
    yield line


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
