"""How a team hears its sensors: streams of records as rows for the filters, by time, and what of them is due."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from outrider.data import Datum, Kind, Stream
from outrider.filters.channels import site_position
from outrider.filters.cooperative.fusion import NO_RECORDS
from outrider.filters.cooperative.robot import Records
from outrider.filters.state import ROWS
from outrider.models.sensors import SensorModel
from outrider.typing import Floats


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
    """Records of one ear. t : (n,) s, not decreasing;  ear : which;  z, r : (n, ROWS) values and variances."""

    t: Floats
    ear: int
    z: Floats
    r: Floats


def rows_of(k: int, e: Ear, s: Stream, start: int, datum: Datum) -> Batch:
    """A stream as ear k hears it, in the order of time since `start` [ns]; a row that is not finite is not in use."""
    own = s if not e.partner else s.select(s.z[:, 0] == e.number)
    if (own.t[1:] < own.t[:-1]).any():
        own = own.select(np.argsort(own.t, kind="stable"))
    z = site_position(own, datum) if own.kind is Kind.GNSS else own.z[:, e.columns[0] : e.columns[1]]
    out, r = np.zeros((len(own), ROWS)), np.empty((len(own), ROWS))
    out[:, : z.shape[1]], r[:, : len(e.sigmas)], r[:, len(e.sigmas) :] = z, np.array(e.sigmas) ** 2, np.inf
    if not np.isfinite(z).all():
        bad = ~np.isfinite(out).all(axis=1)
        out[bad], r[bad] = 0.0, np.inf
    return Batch(np.asarray((own.t - start) * 1e-9, np.float64), k, out, r)


def split(b: Batch, until: float) -> tuple[Batch, Batch]:
    """What is due up to `until` [s], and what is later."""
    if not b.t.size or b.t[-1] <= until:
        return b, b._replace(t=b.t[:0], z=b.z[:0], r=b.r[:0])
    n = int(np.searchsorted(b.t, until, side="right"))
    return b._replace(t=b.t[:n], z=b.z[:n], r=b.r[:n]), b._replace(t=b.t[n:], z=b.z[n:], r=b.r[n:])


def merged(
    batches: Sequence[tuple[str, Batch]], number: Mapping[tuple[str, int], int], ears: Mapping[str, Sequence[Ear]]
) -> Records:
    """All rows by time, at one time relative ones last. number : (robot, ear) -> source of the filter"""
    if not batches:
        return NO_RECORDS
    sizes = [b.t.size for _, b in batches]
    t = np.concatenate([b.t for _, b in batches])
    source = np.repeat(np.array([number[name, b.ear] for name, b in batches], np.int64), sizes)
    last = np.repeat([bool(ears[name][b.ear].partner) for name, b in batches], sizes)
    order = np.lexsort((source, last, t))
    z, r = np.concatenate([b.z for _, b in batches]), np.concatenate([b.r for _, b in batches])
    return Records(t=t[order], source=source[order], z=z[order], r=r[order])
