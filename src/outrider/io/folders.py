"""Folders of results: complete or not there at all, and never over anything but an earlier result of the same kind.

A result's folder holds a *marker*, a JSON document whose `schema` says what the folder is and whose `files` lists what
belongs to it. Whatever else a user keeps in such a folder stays.
"""

import json
import os
import shutil
import tempfile
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from errno import EACCES, ENOTDIR
from math import isfinite
from pathlib import Path
from typing import Any, cast

import numpy as np

from outrider.errors import DataError, OutputExistsError, UsageError
from outrider.io.files import is_directory


def as_json(document: Mapping[str, object]) -> str:
    """A document as JSON text; numbers that are not finite are null."""
    text = json.dumps(plain(document), indent=2, ensure_ascii=False, allow_nan=False)
    return text.encode("utf-8", "backslashreplace").decode()  # a file name may hold half of a character


def plain(value: object) -> Any:
    """Dicts, lists, numbers and strings only; NaN and infinity as None."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in cast("Mapping[object, object]", value).items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in cast("list[object]", value)]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(cast("Any", value).tolist())
    return None if isinstance(value, float) and not isfinite(value) else value


def write_marker(folder: Path, name: str, document: Mapping[str, object]) -> None:
    """Write the marker of a finished result, with the files that are there."""
    files = sorted({p.name for p in folder.iterdir()} | {name})
    (folder / name).write_text(as_json({**document, "files": files}) + "\n", encoding="utf-8")


def read_marker(folder: Path, name: str, schema: str) -> dict[str, Any]:
    """The marker of a folder; `DataError` if there is none, or of another schema than this version understands."""
    path = folder / name
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        raise DataError("is no folder of results", where=str(folder), fix=f"it has no {name}") from None
    except ValueError:
        raise DataError("is damaged", where=str(path), fix="make it again") from None
    found = str(cast("dict[str, Any]", document).get("schema", "")) if isinstance(document, dict) else ""
    if found != schema:
        raise DataError(f"has the schema '{found}', this version reads {schema}", where=str(path), fix="make it again")
    return cast("dict[str, Any]", document)


def is_result(folder: Path, name: str, schema: str) -> bool:
    """Whether a folder holds a result of this kind, in any version of its schema."""
    return str(_document(folder / name).get("schema", "")).split("/")[0] == schema.split("/")[0]


def ensure_free(folder: Path, name: str, schema: str, *, force: bool = False) -> None:
    """Refuse a folder that holds anything, unless `force` and what it holds is an earlier result of this kind; and one
    that cannot be made."""
    if os.path.lexists(folder) and not is_directory(folder):
        raise OutputExistsError("exists and is not a directory", where=str(folder), fix="--output names another")
    try:
        _ensure_writable(folder)
        empty = not folder.is_dir() or not any(folder.iterdir())
    except OSError as e:
        fix = "--output names another folder"
        raise UsageError(f"cannot be written: {(e.strerror or str(e)).lower()}", where=str(folder), fix=fix) from None
    if empty:
        return
    if not is_result(folder, name, schema):
        what = "holds files that --force does not overwrite" if force else "is not empty"
        raise OutputExistsError(what, where=str(folder), fix="--output names another folder")
    if not force:
        fix = "--force replaces it, --output names another folder"
        raise OutputExistsError("holds an earlier result", where=str(folder), fix=fix)


def _ensure_writable(folder: Path) -> None:
    """Raise what making the folder would raise, as far as can be told without making it."""
    with suppress(FileNotFoundError):
        folder.stat()  # too long a name, a place that may not be looked at, a file on the way
    above = next((p for p in folder.absolute().parents if os.path.lexists(p)), folder)
    if not above.is_dir():
        raise NotADirectoryError(ENOTDIR, f"{above} is no directory")
    if not os.access(above, os.W_OK | os.X_OK):
        raise PermissionError(EACCES, f"no permission to write in {above}")
    if folder.is_dir() and not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(EACCES, "permission denied")


@contextmanager
def result_folder(folder: Path, name: str, schema: str, *, force: bool = False) -> Generator[Path, None, None]:
    """Yield a hidden directory beside `folder` that takes its place when the block succeeds, and vanishes otherwise.

    An earlier result is replaced file by file, the marker last. The block must write the marker.
    """
    ensure_free(folder, name, schema, force=force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    except OSError as e:
        raise UsageError(f"cannot be created: {(e.strerror or str(e)).lower()}", where=str(folder)) from None
    try:
        yield part
        ensure_free(folder, name, schema, force=force)  # another run may have taken it meanwhile
        _settle(part, folder, name)
    except OSError as e:  # a full disk, most likely
        raise UsageError(f"cannot be written: {(e.strerror or str(e)).lower()}", where=str(folder)) from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _settle(part: Path, folder: Path, name: str) -> None:
    """Move what was written to its place."""
    part.chmod(0o755)  # mkdtemp makes it private
    if not folder.exists() or not any(folder.iterdir()):
        part.rename(folder)
        return
    earlier = cast("list[object]", _document(folder / name).get("files", []))
    for old in (Path(str(f)).name for f in earlier):  # names only: a marker cannot point elsewhere
        if old and not (part / old).exists():
            (folder / old).unlink(missing_ok=True)
    for path in sorted(part.iterdir(), key=lambda p: p.name == name):
        path.replace(folder / path.name)


def _document(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return cast("dict[str, Any]", document) if isinstance(document, dict) else {}
