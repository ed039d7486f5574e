"""A robot's own idea of where it is: its records through the online filter."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import final

import numpy as np

from outrider.core.rotations import quat_from_matrix
from outrider.data import Datum, Gaussian, Kind, Stream, stream
from outrider.filters.channels import Rest, records
from outrider.filters.engine import Filter, OnlineFilter
from outrider.filters.screen import Memory, screen
from outrider.models.kinematics import K_P, K_R, K_SIZE, K_V, K_W, T_P, T_SIZE
from outrider.models.motion import kinematic_view
from outrider.team.odometry import Odometry
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fused:
    """An estimate carried to one moment. p, v : (3,) site frame;  heading [rad];  w : yaw rate [rad/s];  q : (4,);
    P : (3, 3) of the position."""

    t: int
    p: Floats
    v: Floats
    q: Floats
    heading: float
    w: float
    P: Floats


@final
class Navigator:
    """Screens what arrives, fuses it, late records included, and carries the estimate to now.

    odometry : makes twists of the rim speeds of a base, None where nothing has to."""

    def __init__(
        self,
        f: Filter,
        prior: Gaussian,
        start: int,
        datum: Datum,
        robot: str = "robot",
        odometry: Odometry | None = None,
    ) -> None:
        self._filter, self._start, self._datum, self.robot, self._odometry = f, start, datum, robot, odometry
        self._online = OnlineFilter(f, prior, 0.0)
        self._memory: dict[str, Memory] = {}
        self._order = [0] * len(f.channels)
        self._rest = [Rest() for _ in f.channels]
        self.refused = 0

    def take(self, news: Iterable[Stream]) -> None:
        """Fuse the records of every stream that a channel listens to."""
        for new in news:
            s = new if self._odometry is None or new.name != self._odometry.name else self._odometry.twist(new)
            verdict = screen(s, self._memory.setdefault(s.name, Memory()))
            self.refused += int((verdict != 0).sum())
            for code, channel in enumerate(self._filter.channels):
                if channel.stream != s.name:
                    continue
                made = records(channel, s, verdict, self._datum, self._rest[code])
                seconds = np.asarray((made.t - self._start) * 1e-9, np.float64)
                self._online.take(seconds, code, made.z, made.r, made.flag, self._order[code] + 1)
                self._order[code] += made.t.size

    @property
    def newest(self) -> int:
        """When the newest record that was fused was made [ns]."""
        return self._start + round(self._online.time * 1e9)

    def now(self, t: int) -> Fused:
        """The estimate at t [ns], carried on at its own velocity and yaw rate since the newest record."""
        belief = self._online.belief
        k, K = np.zeros(K_SIZE), np.zeros((T_SIZE, belief.layout.error_size))
        kinematic_view(int(self._filter.motion), belief.x, self._online.state.u, self._filter.theta, k, K)
        ahead = min(max((t - self._start) * 1e-9 - self._online.time, 0.0), 1.0)
        R, v, w = k[K_R : K_R + 9].reshape(3, 3), k[K_V : K_V + 3], float(k[K_W + 2])
        rows, q = K[T_P : T_P + 3], np.empty(4)
        quat_from_matrix(R, q)
        return Fused(
            t=t,
            p=k[K_P : K_P + 3] + v * ahead,
            v=v.copy(),
            q=q,
            heading=float(np.arctan2(R[1, 0], R[0, 0])) + w * ahead,
            w=w,
            P=rows @ belief.P @ rows.T,
        )

    def record(self, now: Fused) -> Stream:
        """The estimate as a record of the log."""
        z = np.concatenate([now.p, now.q, now.v])[None]
        return stream("estimate", Kind.ESTIMATE, np.array([now.t]), z, robot=self.robot, frame="base_link")

    def command(self, now: Fused, twist: Floats) -> Stream:
        """What the robot is told to do, (3,) in its body, as a record: velocity in the site frame, yaw rate beside."""
        c, s = np.cos(now.heading), np.sin(now.heading)
        z = np.array([[c * twist[0] - s * twist[1], s * twist[0] + c * twist[1], 0.0]])
        turn = {"w_z": np.array([twist[2]])}
        return stream("command", Kind.COMMAND, np.array([now.t]), z, robot=self.robot, frame="base_link", extra=turn)
