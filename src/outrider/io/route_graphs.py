"""Route graphs as nav2_route reads them: GeoJSON in metres, a point per node, a line per direction of an edge."""

from collections.abc import Mapping
from math import inf, isfinite
from pathlib import Path
from typing import Any, Final, cast

import numpy as np

from outrider.data.routes import RouteGraph
from outrider.errors import DataError
from outrider.io.files import replacing
from outrider.io.geojson import features_of, located

_SPEED, _WIDTH, _NAME = "abs_speed_limit", "width", "name"
_FIRST_EDGE: Final = 10_000  # nodes and edges share one range of ids


def write_route_graph(graph: RouteGraph, path: Path, *, frame: str = "map", force: bool = False) -> None:
    """Write a graph; names, speeds and widths are metadata, as nav2_route hands them on (speed: `abs_speed_limit`)."""
    import json

    first_edge = max(_FIRST_EDGE, 10 ** len(str(len(graph.names))))
    nodes = [
        _feature("Point", p.tolist(), {"id": k, "frame": frame, "metadata": {_NAME: name}})
        for k, (name, p) in enumerate(zip(graph.names, graph.nodes, strict=True))
    ]
    edges: list[dict[str, Any]] = []
    for k, (a, b) in enumerate(graph.edges.tolist()):
        told = {_SPEED: float(graph.speed[k]), _WIDTH: float(graph.width[k])}
        more = {"metadata": {key: v for key, v in told.items() if isfinite(v)}} if min(told.values()) < inf else {}
        line = [[graph.nodes[a].tolist(), graph.nodes[b].tolist()]]
        edges.append(_feature("MultiLineString", line, {"id": first_edge + k, "startid": a, "endid": b, **more}))
    lines = ",\n".join(json.dumps(f, ensure_ascii=False) for f in [*nodes, *edges])
    with replacing(path, force=force) as part:
        text = f'{{"type": "FeatureCollection", "name": "routes", "features": [\n{lines}\n]}}\n'
        part.write_text(text, encoding="utf-8")


def read_route_graph(path: Path) -> RouteGraph:
    """Read a graph of nav2_route. An edge between the same nodes twice is there once; a node without a name has its id.

    Raises DataError, with the feature, for what is no such graph.
    """
    rows: dict[int, int] = {}
    names: list[str] = []
    nodes: list[tuple[float, float]] = []
    edges: dict[tuple[int, int], tuple[float, float]] = {}
    features = features_of(path)
    for k, feature in enumerate(features):
        with located(path, k):
            kind = feature["geometry"]["type"]
            if kind == "Point":
                rows[_whole(feature, "id")] = len(names)
                names.append(str(_metadata(feature).get(_NAME, feature["properties"]["id"])))
                x, y = (float(v) for v in feature["geometry"]["coordinates"][:2])
                if not (isfinite(x) and isfinite(y)):
                    raise DataError("is not finite")
                nodes.append((x, y))
    for k, feature in enumerate(features):
        with located(path, k):
            if feature["geometry"]["type"] in ("LineString", "MultiLineString"):
                ends = [_whole(feature, key) for key in ("startid", "endid")]
                if lost := [e for e in ends if e not in rows]:
                    raise DataError(f"leads to node {lost[0]}, which is not there")
                told = _metadata(feature)
                edges[rows[ends[0]], rows[ends[1]]] = _positive(told, _SPEED), _positive(told, _WIDTH)
    limits = np.array(list(edges.values()), np.float64).reshape(-1, 2)
    try:
        return RouteGraph(
            names=tuple(names),
            nodes=np.array(nodes, np.float64).reshape(-1, 2),
            edges=np.array(list(edges), np.int64).reshape(-1, 2),
            speed=limits[:, 0].copy(),
            width=limits[:, 1].copy(),
        )
    except DataError as e:
        raise DataError(e.what, where=str(path), fix=e.fix) from None


def _feature(kind: str, coordinates: object, properties: Mapping[str, object]) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": dict(properties),
        "geometry": {"type": kind, "coordinates": coordinates},
    }


def _metadata(feature: Mapping[str, Any]) -> Mapping[str, Any]:
    told = feature["properties"].get("metadata") or {}
    return cast("Mapping[str, Any]", told) if isinstance(told, Mapping) else {}


def _whole(feature: Mapping[str, Any], key: str) -> int:
    value = feature["properties"].get(key)
    if not isinstance(value, int) or isinstance(value, bool):
        raise DataError(f"has no whole number `{key}`", fix="is it a graph of nav2_route?")
    return value


def _positive(told: Mapping[str, Any], key: str) -> float:
    value = told.get(key, inf)
    if not isinstance(value, (int, float)) or not value > 0.0:
        raise DataError(f"{key} is {value!r}", fix="a number above zero")
    return float(value)
