"""What `--version` prints, without importing any of it."""

import platform
from importlib.metadata import PackageNotFoundError, version

from outrider import __version__

PACKAGES = (
    "numpy", "scipy", "numba", "pymap3d", "pygeomag", "rosbags", "pyulog", "pymavlink", "pydantic", "pyarrow",
    "matplotlib", "typer", "rich",
)  # fmt: skip


def version_text() -> str:
    """Our version, then one line for each package that results or readers depend on."""
    lines = [f"outrider {__version__}", f"python {platform.python_version()} {platform.system()} {platform.machine()}"]
    for name in PACKAGES:
        try:
            lines.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            lines.append(f"{name} is missing")
    return "\n".join(lines)
