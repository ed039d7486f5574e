"""How late a receiver is stamped against an IMU that drives the estimate, by the likelihood of innovations.

What a flight shows in common to both, accelerations, drowns in vibration and between two fixes; the whole filter weighs
all of it. One run of the log per delay: three to see whether there is anything, then a search.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, final

import numpy as np

from outrider.data import EventLog, Finding, Kind
from outrider.data.evidence import Curve, Evidence
from outrider.errors import OutriderError
from outrider.filters.align import Alignment
from outrider.models.motion import Motion
from outrider.models.sensors import Sensor
from outrider.typing import Floats
from outrider.workflows.bench import Bench, Innovations
from outrider.workflows.config import FuseConfig, SourceSection
from outrider.workflows.discover import choose_motion, screened
from outrider.workflows.findings.say import warning
from outrider.workflows.parameters import Parameter, What

LONGEST_S: Final = 60.0  # of the log: more tells hardly more
FIRST: Final = 0.15  # s: delays tried first are none, this much late, and this much early
FITS: Final = 1.5  # NIS per degree of freedom: of positions that fit as they are
SEARCH: Final = np.arange(-8, 9) * 0.15  # s
NARROWER: Final = (0.07, 0.03)  # s: parabolas through the best and its neighbours so far away
CLIP: Final = 25.0  # NIS per degree of freedom at which one record's say stops growing
SOFTEST: Final = 0.5  # times the believed noise: what Doppler velocities may have less of
TEMPER: Final = 2.0  # log-likelihoods are divided by this, for no model is quite true
HARMLESS: Final = 0.06  # s
SURE: Final = 3.0  # deviations that a delay must be from none
GAIN: Final = 10.0  # log-likelihood that it must win over any other far from it
FAR: Final = 0.3  # s


@final
@dataclass(frozen=True, slots=True)
class Late:
    """streams : of the receiver;  delay : s that their stamps are late;  sd : of it;  tried : (2, n) delays [s] and
    log-likelihoods of the innovations."""

    streams: tuple[str, ...]
    delay: float
    sd: float
    tried: Floats = field(compare=False)


def receiver_clock(log: EventLog, cfg: FuseConfig) -> Late | None:
    """The delay of the first receiver against the IMU; None where it is none, not clear, or already told."""
    if not log.of(Kind.IMU) or not log.of(Kind.GNSS, Kind.POSITION):
        return None
    if choose_motion(log, cfg, screened(log)) is not Motion.STRAPDOWN:
        return None
    try:
        bench = Bench(log, cfg)
    except OutriderError:
        return None  # the job itself says what is wrong
    groups = bench.receivers()
    if len(groups) != 1:
        return None
    if any("delay_s" in cfg.sources.get(name, SourceSection()).model_fields_set for name in groups[0]):
        return None
    return search(bench, Parameter(What.DELAY, groups[0]))


def search(bench: Bench, p: Parameter) -> Late | None:
    """The delay at which the innovations are least surprising."""
    fit = likelihoods(bench, p, bench.aligned)
    here, nis = fit(0.0)
    if here >= max(fit(-FIRST)[0], fit(FIRST)[0]) and nis < FITS:
        return None
    scores = np.array([fit(float(d))[0] for d in SEARCH])
    best = float(SEARCH[int(np.argmax(scores))])
    others = scores[np.abs(SEARCH - best) > FAR]
    if abs(best) > SEARCH[-1] - FAR or others.size == 0 or scores.max() - others.max() < GAIN:
        return None
    sd, fit = np.inf, likelihoods(bench, p, bench.align({p: best}))
    for step in NARROWER:
        low, mid, high = (fit(best + k * step)[0] for k in (-1, 0, 1))
        bend = low - 2.0 * mid + high
        if bend >= 0.0:
            return None
        best += float(np.clip(0.5 * (low - high) / bend, -1.5, 1.5)) * step
        sd = float(np.sqrt(TEMPER / -bend)) * step
    clear = abs(best) > max(HARMLESS, SURE * sd) and fit(best)[0] - max(here, fit(0.0)[0]) > 0.5 * SURE**2
    return Late(p.streams, best, sd, np.stack([SEARCH, scores]).astype(np.float64)) if clear else None


def likelihoods(bench: Bench, p: Parameter, start: Alignment) -> Callable[[float], tuple[float, float]]:
    """Log-likelihood (to a constant) and NIS per degree of freedom of the receiver's records by delay, from one start:
    a delay hardly turns it, and the filter forgets it."""
    own = [
        (k, SOFTEST if c.sensor is Sensor.GNSS_VELOCITY else 1.0)
        for k, c in enumerate(bench.channels)
        if c.stream in p.streams and not c.scored
    ]
    seen: dict[float, tuple[float, float]] = {}

    def fit(delay: float) -> tuple[float, float]:
        if delay not in seen:
            run = bench.run({p: delay}, start=start, until=start.t_start + LONGEST_S)
            said = [say(run[k], softest) for k, softest in own]
            dof = sum(s[2] for s in said)
            seen[delay] = sum(s[0] for s in said) / TEMPER, sum(s[1] for s in said) / max(dof, 1)
        return seen[delay]

    return fit


def say(i: Innovations, softest: float) -> tuple[float, float, int]:
    """Log-likelihood, sum of NIS and degrees of freedom of a channel's records. softest : least factor of its noise.

    Its noise is known but for a factor, and the likelihood is that of the best one: with a mean NIS of k it is
    -(n log k + sum log s^2) / 2. A claim that is too small weighs less, and velocities that are better than believed
    weigh more; positions do not, for those of a receiver that smooths them err slowly, not less.
    """
    ok = i.dof > 0
    nis, dof, s = np.fmin(i.nis[ok], CLIP * i.dof[ok]), i.dof[ok], i.s[ok]
    n, spread = int(dof.sum()), float(np.log(np.where(s > 0.0, s, 1.0)).sum())
    mean = float(np.nansum(nis)) / max(n, 1)
    k = max(mean, softest**2)
    return -0.5 * n * (np.log(k) + mean / k) - spread, float(np.nansum(i.nis[ok])), n


def told(found: Late) -> Finding:
    """In words."""
    way = "late" if found.delay > 0 else "early"
    name, delay = found.streams[0], round(found.delay, 3)
    text = f"{name} is stamped {abs(delay):.2f} s (+-{2 * found.sd:.2f}) too {way} against the IMU: taken off"
    said = warning("clock-offset", text, name, f"sources: {{{name}: {{delay_s: {delay}}}}}")
    return replace(said, evidence=shown(found))


def shown(found: Late) -> Evidence:
    """How well the positions fit by delay."""
    delays, fits = found.tried
    return Evidence(
        x_label=f"{found.streams[0]} taken as late by [s]", y_label="fit (log-likelihood)",
        curves=(Curve(x=delays, y=fits - fits.max()),), at=((0.0, "as stamped"), (found.delay, "fits best")),
        text="A minute of the log was fused once per delay: how well the positions fit what the IMU tells.",
    )  # fmt: skip


__all__ = ["Late", "receiver_clock", "told"]
