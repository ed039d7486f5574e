"""Wind: a mean and Dryden gusts, as three filters driven by white noise.

Source: MIL-F-8785C (1980), 3.7.2, Dryden form at low altitude. The filters are discretized exactly and start in their
steady state, so variance and correlation are right at any step and from the first sample on.
"""

from dataclasses import dataclass
from math import exp, hypot, sqrt
from typing import final

import numpy as np
from numpy.random import Generator

from outrider._kernel import kernel
from outrider.core.sampling import covariance_root
from outrider.typing import Floats

FOOT = 0.3048  # m
_LOWEST, _HIGHEST = 10.0, 1000.0  # ft: where the low-altitude form holds
CALMEST = 1.0  # m/s: gusts are carried past at least so fast


@kernel
def _filter(x: Floats, carry: Floats) -> None:
    """x (n, k) <- x_i + carry x_(i-1), from white steps to a process."""
    n, k = x.shape
    for i in range(1, n):
        for r in range(k):
            for c in range(k):
                x[i, r] += carry[r, c] * x[i - 1, c]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Wind:
    """Mean (3,) m/s ENU; gusts of deviation `sigma` [m/s] and scale `length` [m] along the mean wind, across it and up.

    `airspeed` [m/s] carries the frozen gusts past a robot; by default the mean wind does, at no less than 1 m/s.
    Without a horizontal mean, "along" is east.
    """

    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sigma: tuple[float, float, float] = (0.0, 0.0, 0.0)
    length: tuple[float, float, float] = (200.0, 200.0, 50.0)
    airspeed: float | None = None

    @classmethod
    def dryden(
        cls,
        mean: tuple[float, float, float],
        *,
        height: float,
        at_20_ft: float | None = None,
        airspeed: float | None = None,
    ) -> "Wind":
        """Gusts of the low-altitude form at `height` [m]; `at_20_ft`: wind speed [m/s] at 6 m, the mean's by default.

        sigma_w = 0.1 W_20,  sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4,
        L_w = h,  L_u = L_v = h / (0.177 + 0.000823 h)^1.2,  h in feet, held to 10 .. 1000.
        """
        h = min(max(height / FOOT, _LOWEST), _HIGHEST)
        shape = 0.177 + 0.000823 * h
        up = 0.1 * (hypot(mean[0], mean[1]) if at_20_ft is None else at_20_ft)
        level, scale = up / shape**0.4, h * FOOT / shape**1.2
        return cls(mean=mean, sigma=(level, level, up), length=(scale, scale, h * FOOT), airspeed=airspeed)

    def sample(self, rng: Generator, n: int, dt: float) -> Floats:
        """(n, 3) m/s ENU, every dt [s]. A longer sample from the same generator begins with the shorter one.

        Along: sigma sqrt(2 T) / (1 + T s), else sigma sqrt(T) (1 + sqrt(3) T s) / (1 + T s)^2, with T = L / V.
        """
        speed = max(hypot(self.mean[0], self.mean[1]), CALMEST) if self.airspeed is None else self.airspeed
        z = rng.standard_normal((n, 5))
        gust = np.empty((n, 3))
        gust[:, 0] = _along(z[:, :1], dt * speed / self.length[0])
        gust[:, 1] = _across(z[:, 1:3], dt * speed / self.length[1])
        gust[:, 2] = _across(z[:, 3:], dt * speed / self.length[2])
        gust *= self.sigma
        level = hypot(self.mean[0], self.mean[1])
        c, s = (self.mean[0] / level, self.mean[1] / level) if level > 0.0 else (1.0, 0.0)
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])  # from (along, to its left, up) to ENU
        return np.array(self.mean) + gust @ R.T


def _along(z: Floats, step: float) -> Floats:
    """(n,) of variance 1, autocorrelation e^-x, samples `step` apart."""
    keep = exp(-step)
    x = z.copy()
    x[1:] *= sqrt(1.0 - keep * keep)
    _filter(x, np.array([[keep]]))
    return x[:, 0]


def _across(z: Floats, step: float) -> Floats:
    """(n,) of variance 1, autocorrelation e^-x (1 - x / 2).

    States a' = -a + noise, b' = a - b have the steady covariance below; the output is sqrt(3) a + (1 - sqrt(3)) b.
    """
    steady = np.array([[0.5, 0.25], [0.25, 0.25]])
    carry = exp(-step) * np.array([[1.0, 0.0], [step, 1.0]])
    x = z @ covariance_root(steady - carry @ steady @ carry.T)
    x[:1] = z[:1] @ covariance_root(steady)
    _filter(x, carry)
    return x @ np.array([sqrt(3.0), 1.0 - sqrt(3.0)])
