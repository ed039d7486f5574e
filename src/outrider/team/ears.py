"""How a team hears its sensors: streams of records as rows for the filters, by time, and what of them is due."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from outrider.data import Datum, Kind, Stream
from outrider.filters.channels import site_position
from outrider.filters.cooperative.fusion import NO_RECORDS
from outrider.filters.cooperative.robot import Records
from outrider.filters.state import ROWS
from outrider.models.sensors import SensorModel
from outrider.typing import Bools, Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Ear:
    """How a stream of one robot is heard. columns : of its z, first and end;  sigmas : (m,), infinite: not in use;
    partner : who is seen, by `number` in the first column;  navigation : whether `Method.NONE` has it, too."""

    stream: str
    sensor: SensorModel
    sigmas: tuple[float, ...]
    columns: tuple[int, int] = (0, ROWS)
    partner: str = ""
    number: float = -1.0
    navigation: bool = True


class Batch(NamedTuple):
    """Records of one ear. t : (n,) s, not decreasing;  ear : which;  z : (n, columns) as its sensor reads them."""

    t: Floats
    ear: int
    z: Floats


class Table(NamedTuple):
    """The sources of one filter. variances : (sources, ROWS), infinite: not in use;  late : (sources,) whether theirs
    come last among records of one time: those that are about a partner."""

    variances: Floats
    late: Bools


def table_of(ears: Sequence[Ear]) -> Table:
    """As the filters read the records of these ears."""
    return Table(np.array([variances_of(e) for e in ears]).reshape(-1, ROWS), np.array([bool(e.partner) for e in ears]))


def variances_of(e: Ear) -> Floats:
    """(ROWS,) of a record of one ear."""
    return np.array([s**2 for s in e.sigmas] + [np.inf] * (ROWS - len(e.sigmas)))


def rows_of(k: int, e: Ear, s: Stream, start: int, datum: Datum) -> Batch:
    """A stream as ear k hears it, in the order of time since `start` [ns]."""
    own = s if not e.partner else s.select(s.z[:, 0] == e.number)
    if len(own) > 1 and (own.t[1:] < own.t[:-1]).any():
        own = own.select(np.argsort(own.t, kind="stable"))
    z = site_position(own, datum) if own.kind is Kind.GNSS else own.z[:, e.columns[0] : e.columns[1]]
    return Batch(np.asarray((own.t - start) * 1e-9, np.float64), k, z)


def in_use(z: Floats, r: Floats) -> tuple[Floats, Floats]:
    """Rows z, r (n, ROWS); one that is not finite is not in use."""
    good = np.isfinite(z)
    if good.all():
        return z, r
    bad = ~np.logical_and.reduce(good, axis=1, keepdims=True)
    return np.where(bad, 0.0, z), np.where(bad, np.inf, r)


def padded(b: Batch, e: Ear) -> tuple[Floats, Floats]:
    """Values and variances (n, ROWS) of a batch of one ear; a row that is not finite is not in use."""
    z, r = np.zeros((b.t.size, ROWS)), np.tile(variances_of(e), (b.t.size, 1))
    z[:, : b.z.shape[1]] = b.z
    return in_use(z, r)


def split(b: Batch, until: float) -> tuple[Batch, Batch | None]:
    """What is due up to `until` [s], and what is later, if anything is."""
    if not b.t.size or b.t[-1] <= until:
        return b, None
    n = int(np.searchsorted(b.t, until, side="right"))
    return Batch(b.t[:n], b.ear, b.z[:n]), Batch(b.t[n:], b.ear, b.z[n:])


def merged(batches: Sequence[tuple[int, Batch]], table: Table) -> Records:
    """All rows by time, at one time relative ones last. batches : with their sources of the filter"""
    if not batches:
        return NO_RECORDS
    t = np.concatenate([b.t for _, b in batches])
    source, z = np.empty(t.size, np.int64), np.zeros((t.size, ROWS))
    first = 0
    for s, b in batches:
        rows = slice(first, first + b.t.size)
        source[rows], z[rows, : b.z.shape[1]] = s, b.z
        first = rows.stop
    order = np.lexsort((source, table.late[source], t))
    source = source[order]
    z, r = in_use(z[order], table.variances[source])
    return Records(t=t[order], source=source, z=z, r=r)
