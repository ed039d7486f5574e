"""What the wheels of a base say of its motion, and how far they contradict one another."""

from dataclasses import dataclass, field
from typing import Final, final

import numpy as np

from outrider.data import Kind, Stream, stream
from outrider.typing import Bools, Floats, Ints

STILL: Final = 0.01  # m/s of every rim
REST_S: Final = 0.3  # s for which they stand before the base counts as at rest
REST_RATE: Final = 0.001  # rad/s that a base at rest turns
TURNING: Final = 0.5  # rad/s: what wheels that turn are worth for the yaw rate, beside a gyro


@final
@dataclass(slots=True, kw_only=True)
class Odometry:
    """Rim speeds V (n) as the twist u = J+ V of the body, with the covariance s^2 J+ J+'.

    J (n, 3) is `inverse`. s is the larger of `sigma`, below which no rim speed is believed [m/s], and of what no twist
    explains, |V - J u| / sqrt(n - 3): wheels that slip contradict one another, and say so. What the base cannot do (a
    row of zeros of J+) has no variance. Wheels are not all of one size: their yaw rate counts at rest only, which shows
    the bias of a gyro. name : of the stream of the encoders, whose records come in order.
    Source: amr2025 (8)-(10), for any number of wheels; the doubt is ours.
    """

    name: str
    inverse: Floats
    sigma: float = 0.02
    forward: Floats = field(init=False, repr=False, compare=False)
    _moved: int | None = None  # ns, when a rim last turned

    def __post_init__(self) -> None:
        self.forward = np.ascontiguousarray(np.linalg.pinv(self.inverse), np.float64)

    def twist(self, s: Stream) -> Stream:
        """The stream (n wheels or more) as one of twists of the same name."""
        n = len(self.inverse)
        rims = s.z[:, :n]
        u = rims @ self.forward.T
        doubt = np.full(len(s), self.sigma**2)
        if n > 3:
            doubt = np.maximum(doubt, ((rims - u @ self.inverse.T) ** 2).sum(axis=1) / (n - 3))
        gain = (self.forward**2).sum(axis=1)
        resting = self._resting(s.t, rims)
        z, var = np.zeros((len(s), 6)), np.full((len(s), 6), np.nan)
        columns = np.array([0, 1, 5])
        z[:, columns] = u
        var[:, columns] = np.where(gain > 1e-12, doubt[:, None] * gain, np.nan)
        var[:, 5] = np.where(resting, REST_RATE, TURNING) ** 2
        return stream(s.name, Kind.TWIST, s.t, z, var=var, t_arrival=s.t_arrival, robot=s.robot, frame=s.frame)

    def _resting(self, t: Ints, rims: Floats) -> Bools:
        """(n,) whether the base has stood for `REST_S` by each record."""
        out = np.zeros(t.size, np.bool_)
        turning: list[bool] = np.any(np.abs(rims) > STILL, axis=1).tolist()
        for k, (now, turns) in enumerate(zip(t.tolist(), turning, strict=True)):
            if turns or self._moved is None:
                self._moved = now
            out[k] = now - self._moved >= round(REST_S * 1e9)
        return out
