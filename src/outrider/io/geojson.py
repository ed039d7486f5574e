"""GeoJSON, as far as shapes are drawn in it: features with a place in the file to complain about."""

import json
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, cast

from outrider.errors import DataError
from outrider.io.files import ensure_readable

LARGEST: Final = 1 << 26  # bytes
GEOMETRIES: Final = ("Point", "LineString", "Polygon", "MultiPoint", "MultiLineString", "MultiPolygon")


def features_of(path: Path) -> list[dict[str, Any]]:
    """The features of a collection, or the single one of a file; all with properties and a geometry of GEOMETRIES.

    Raises DataError for what is no GeoJSON, with the line or the feature.
    """
    document = read_json(path)
    kind = document.get("type")
    found: Any = document.get("features") if kind == "FeatureCollection" else [document]
    if kind not in ("FeatureCollection", "Feature") or not isinstance(found, list):
        raise DataError("is no GeoJSON feature collection", where=str(path), fix='{"type": "FeatureCollection", ...}')
    features: list[dict[str, Any]] = []
    for k, feature in enumerate(cast("list[Any]", found)):
        where = f"{path}: feature {k + 1}"
        if not isinstance(feature, dict) or not isinstance(feature.get("geometry"), dict):
            raise DataError("has no geometry", where=where)
        geometry = cast("dict[str, Any]", feature["geometry"])
        if geometry.get("type") not in GEOMETRIES or not isinstance(geometry.get("coordinates"), list):
            raise DataError(f"is a {geometry.get('type')}", where=where, fix=f"one of: {', '.join(GEOMETRIES)}")
        told = feature.get("properties")
        features.append({**feature, "properties": dict(told) if isinstance(told, Mapping) else {}})
    return features


def read_json(path: Path) -> dict[str, Any]:
    """A JSON document that is an object; DataError, with the line, for anything else."""
    ensure_readable(path)
    if path.stat().st_size > LARGEST:
        raise DataError("is longer than 64 MiB", where=str(path), fix="export only what belongs to the site")
    try:
        document = json.loads(path.read_text(encoding="utf-8-sig"))
    except json.JSONDecodeError as e:
        raise DataError(f"is no JSON: {e.msg.lower()}", where=f"{path}:{e.lineno}") from None
    except UnicodeDecodeError:
        raise DataError("is no text (UTF-8)", where=str(path)) from None
    except RecursionError:
        raise DataError("is nested too deeply", where=str(path)) from None
    if not isinstance(document, dict):
        raise DataError("is no JSON object", where=str(path))
    return cast("dict[str, Any]", document)


@contextmanager
def located(path: Path, index: int, name: str = "") -> Generator[None, None, None]:
    """Say which feature of a file a fault is in."""
    place = f"{path}: feature {index + 1}" + (f" '{name}'" if name else "")
    try:
        yield
    except DataError as e:
        raise DataError(f"{e.where} {e.what}" if e.where else e.what, where=place, fix=e.fix) from None
    except (TypeError, ValueError, KeyError, IndexError, OverflowError):
        raise DataError("has coordinates that make no sense", where=place) from None
