"""How close a follower may fly: the least distance from which everything the target may do can still be answered.

The least set-point is the distance at which a follower that goes along at the target's speed may, by
`outrider.safety.separation`, just go on until the next fix of the target is due. From rate, delay, braking, noise and
what the target can do it follows before anything flies; the same function adapts it in flight.
"""

from dataclasses import dataclass, replace
from math import degrees, exp, inf, isfinite, nan, sqrt
from typing import Final, final

from outrider._kernel import kernel
from outrider.errors import ConfigError
from outrider.safety.separation import T_DISTANCE, Separation, largest_approach, lowest
from outrider.typing import Floats

FARTHEST: Final = 64.0  # m beyond R_d, at which the search begins
HALVINGS: Final = 14
EASE: Final = 0.03  # m more than the least, so that noise does not make the filter intervene all the time


@kernel
def least_set_point(speed: float, age: float, pp: float, pv: float, vv: float, theta: Floats) -> float:
    """The least distance [m] at which a follower may go along behind a target of `speed` [m/s], seen `age` [s] ago.

    age : the oldest that a fix becomes;  pp, pv, vv : covariance along the line of sight;  theta : `Separation`.
    Infinite where no distance is enough. To 4 mm, on the safe side.
    """
    low, high, worst = theta[T_DISTANCE], theta[T_DISTANCE] + FARTHEST, lowest(speed, speed, theta)
    if not largest_approach(high - speed * age, speed, speed, worst, age, pp, pv, vv, theta) >= speed:
        return inf
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if largest_approach(middle - speed * age, speed, speed, worst, age, pp, pv, vv, theta) >= speed:
            high = middle
        else:
            low = middle
    return high


@kernel
def adapted(set_point: float, least: float, fall: float) -> float:
    """The next set-point [m]: up to `least` at once, down by at most `fall` [m]: no jump ever sends it forwards."""
    return max(least, set_point - fall)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fixes:
    """What is known of a position, and when. Raises ConfigError for impossible numbers.

    rate_hz : of the fixes;  latency_s : how old one is when it arrives;  sigma : m, each axis
    velocity_sigma : m/s, each axis, infinite for a receiver (or a link) that tells no velocity
    acceleration : m/s^2 per sqrt(Hz), what the filter expects of the target;  own_acceleration : of what disturbs the
    follower, 0.1 in calm air, 0.3 in a moderate wind
    """

    rate_hz: float = 1.0
    latency_s: float = 0.3
    sigma: float = 0.15
    velocity_sigma: float = 0.05
    acceleration: float = 1.0
    own_acceleration: float = 0.1

    def __post_init__(self) -> None:
        for name in ("rate_hz", "sigma", "acceleration", "own_acceleration"):
            if not (isfinite(value := getattr(self, name)) and value > 0.0):
                raise ConfigError(f"{name} is {value}", where="fixes", fix="it must be positive")
        if not self.velocity_sigma > 0.0:
            raise ConfigError(
                f"velocity_sigma is {self.velocity_sigma}", where="fixes", fix="leave it out, or positive"
            )
        if not (isfinite(self.latency_s) and self.latency_s >= 0.0):
            raise ConfigError(f"latency_s is {self.latency_s}", where="fixes", fix="it must not be negative")

    @property
    def oldest_s(self) -> float:
        """The age that a fix reaches before the next one arrives."""
        return 1.0 / self.rate_hz + self.latency_s

    def spread(self, lag_s: float) -> tuple[float, float, float]:
        """(pp, pv, vv) of the target at a fix plus the follower, whose lag is known, when the next one is due."""
        period = 1.0 / self.rate_hz
        target = _steady(period, self.sigma, self.velocity_sigma, self.acceleration, inf)
        own = _steady(period, self.sigma, self.velocity_sigma, self.own_acceleration, lag_s)
        pp, pv, vv = _later(*own, self.oldest_s, self.own_acceleration, lag_s)
        return target[0] + pp, target[1] + pv, target[2] + vv


def _later(pp: float, pv: float, vv: float, T: float, a: float, lag: float) -> tuple[float, float, float]:
    """Covariance of position and velocity after T seconds of white acceleration a on a velocity with a lag."""
    q = a * a
    if lag > 1e3 * T:
        reach, keep = T, 1.0
        grown = q * T**3 / 3.0, 0.5 * q * T * T, q * T
    else:
        keep = exp(-T / max(lag, 1e-3))
        reach = lag * (1.0 - keep)
        spent = 0.5 * lag * (1.0 - keep * keep)
        grown = q * lag * lag * max(T - 2.0 * reach + spent, 0.0), 0.5 * q * reach * reach, q * spent
    return (
        pp + 2.0 * reach * pv + reach * reach * vv + grown[0],
        keep * (pv + reach * vv) + grown[1],
        keep * keep * vv + grown[2],
    )


def _steady(T: float, sigma: float, velocity_sigma: float, a: float, lag: float) -> tuple[float, float, float]:
    """Covariance right after a fix, of a filter that has had many."""
    pp, pv, vv = sigma * sigma, 0.0, 4.0
    for _ in range(int(100 / min(T, 1.0))):
        pp, pv, vv = _later(pp, pv, vv, T, a, lag)
        s = pp + sigma * sigma
        pp, pv, vv = pp - pp * pp / s, pv - pp * pv / s, vv - pv * pv / s
        if isfinite(velocity_sigma):
            s = vv + velocity_sigma * velocity_sigma
            pp, pv, vv = pp - pv * pv / s, pv - pv * vv / s, vv - vv * vv / s
    return pp, pv, vv


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Admissible:
    """An answer to how close.

    set_point : m, to be flown;  least : m, below which the filter would intervene in undisturbed flight
    sigma : m, standard deviation of where the target comes to rest;  warnings : what is held but poorly
    """

    set_point: float
    least: float
    sigma: float
    warnings: tuple[str, ...] = ()


def admissible(
    separation: Separation, fixes: Fixes, target_speed: float, *, set_point: float | None = None, most: float = inf
) -> Admissible:
    """The set-point that holds `separation.distance` from a target of up to `target_speed` [m/s].

    set_point : m, wanted, checked instead of chosen;  most : m, beyond which following is of no use

    Raises ConfigError, saying what to change, where no distance holds, where the one wanted does not, or where the
    follower is no faster than its target.
    """
    where = "follower"
    if not (isfinite(target_speed) and target_speed >= 0.0):
        raise ConfigError(f"a target speed of {target_speed}", where=where, fix="give it in m/s, zero or more")
    if separation.speed <= target_speed:
        what = f"at {separation.speed:g} m/s it never catches up with a target of {target_speed:g} m/s"
        raise ConfigError(what, where=where, fix="a faster follower: 1.2 times the speed of the target or more")
    pp, pv, vv = fixes.spread(separation.lag_s)
    theta = separation.theta()
    least = least_set_point(target_speed, fixes.oldest_s, pp, pv, vv, theta)
    chosen = least + EASE if set_point is None else set_point
    if chosen < least or chosen > most or not isfinite(chosen):
        raise ConfigError(_too_near(separation, fixes, target_speed, least, chosen, most), where=where,
                          fix=_remedy(separation, fixes, target_speed, min(chosen, most)))  # fmt: skip
    lag = separation.other_lag_s
    sigma = sqrt(pp + 2.0 * lag * pv + lag * lag * vv)
    return Admissible(set_point=chosen, least=least, sigma=sigma, warnings=tuple(_warnings(separation, target_speed)))


def least_distance(separation: Separation, fixes: Fixes, target_speed: float, contact: float) -> float:
    """The least R_d [m] of a law that holds R_d itself, as eq. 38 of swarm2023 does: from there it stops short of
    `contact` [m], the distance at which the bodies touch."""
    return least_set_point(
        target_speed, fixes.oldest_s, *fixes.spread(separation.lag_s), replace(separation, distance=contact).theta()
    )  # fmt: skip


def nearest_coming_back(separation: Separation, fixes: Fixes, target_speed: float, set_point: float) -> float:
    """How near [m] a target comes at worst that turns back at `target_speed` [m/s] right after a fix: R_d less what the
    set-point is short of one that holds for that too; -inf where the follower is too slow to get away."""
    if target_speed >= separation.speed:
        return -inf
    back = replace(separation, approach=max(separation.approach, target_speed))
    needs = least_set_point(target_speed, fixes.oldest_s, *fixes.spread(back.lag_s), back.theta())
    return separation.distance + set_point - needs


def promise(separation: Separation, fixes: Fixes, target_speed: float, set_point: float) -> str:
    """What a set-point [m] holds R_d against, and how near a target may come that does more than was declared."""
    x, v = separation, target_speed
    told = f"at {set_point:.2f} m, R_d {x.distance:g} m holds behind a target of up to {v:g} m/s"
    told += f" that stops, climbs or turns by up to {degrees(x.turn):.0f} degrees"
    told += f", or comes back at up to {x.approach:g} m/s" if x.approach > 0.0 else ""
    near = nearest_coming_back(x, fixes, v, set_point)
    if near >= x.distance - EASE:
        return told
    within = f"may get within {near:.2g} m" if near > 0.0 else "may hit it"
    needs = x.distance + set_point - near
    mends = f"'approach: {v:g}' holds R_d then too, at {needs:.2f} m" if isfinite(needs) else "no distance holds then"
    return f"{told}; one that comes back undeclared {within} at worst ({mends})"


def _too_near(x: Separation, f: Fixes, speed: float, least: float, chosen: float, most: float) -> str:
    away = f"R_d {x.distance:g} m from a target of {speed:g} m/s at {f.rate_hz:g} Hz and {f.latency_s:g} s of delay"
    if not isfinite(least):
        return f"no distance holds {away}"
    limit = f"a set-point of {chosen:.3g} m" if chosen < least else f"the {most:.3g} m allowed"
    return f"{limit} cannot hold {away}: it takes {least:.2f} m"


def _remedy(x: Separation, f: Fixes, speed: float, wanted: float) -> str:
    """The first single change that makes the wanted set-point hold, else the distance that does."""

    def takes(x: Separation, f: Fixes, v: float) -> float:
        least = least_set_point(v, f.oldest_s, *f.spread(x.lag_s), x.theta())
        return least if isfinite(least) else nan

    if not isfinite(wanted):
        later = (late for late in (5.0, 2.0, 1.0, 0.5, 0.2) if late < f.latency_s)
        held = next((late for late in later if takes(x, replace(f, latency_s=late), speed) < inf), None)
        return (
            "a slower target, a faster follower, or fixes more often"
            if held is None
            else f"at most {held:g} s of delay"
        )
    for rate in (2.0, 5.0, 10.0):
        if rate > f.rate_hz and takes(x, replace(f, rate_hz=rate), speed) <= wanted:
            return f"fixes at {rate:g} Hz, or a set-point farther away"
    for share in (0.75, 0.5, 0.25):
        if takes(x, f, share * speed) <= wanted:
            return f"a target of at most {share * speed:.2g} m/s, or a set-point farther away"
    return "a set-point farther away, or a smaller R_d"


def _warnings(x: Separation, speed: float) -> list[str]:
    spare = x.speed - speed
    return [f"only {spare:.2g} m/s faster than the target: it comes up slowly"] if spare < 0.2 * speed else []
