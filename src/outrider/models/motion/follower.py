"""A vehicle known by position and velocity only, which follows a commanded velocity with a lag."""

from dataclasses import dataclass
from math import exp
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.data import StateLayout
from outrider.models.kinematics import K_P, K_R, K_V, T_P, T_V
from outrider.typing import Floats

LAYOUT: Final = StateLayout(("position", 3, "m"), ("velocity", 3, "m/s"))


@kernel
def propagate(x: Floats, dt: float, u: Floats, theta: Floats, F: Floats, Q: Floats) -> None:
    """x <- f(x, u, dt), with its Jacobian F (6, 6) and noise Q (6, 6).  u = commanded velocity, world.

    v' = (u - v) / tau, solved exactly over dt;  theta = tau [s], white acceleration [m/s^2 per sqrt(Hz)].
    A constant velocity is tau = infinity.
    """
    tau, sigma = theta[0], theta[1]
    keep = exp(-dt / tau)
    reach = tau * (1.0 - keep) if tau < 1e12 else dt
    q = sigma * sigma
    for i in range(3):
        v = x[3 + i]
        x[i] += u[i] * (dt - reach) + v * reach
        x[3 + i] = keep * v + (1.0 - keep) * u[i]
        F[i, 3 + i], F[3 + i, 3 + i] = reach, keep
        Q[i, i] = q * dt * dt * dt / 3.0
        Q[i, 3 + i] = Q[3 + i, i] = q * dt * dt / 2.0
        Q[3 + i, 3 + i] = q * dt


@kernel
def kinematic_view(x: Floats, u: Floats, theta: Floats, k: Floats, K: Floats) -> None:
    """Write the kinematic view k and its Jacobian K (T_SIZE, 6). The attitude is unknown and stands as the identity."""
    for i in range(3):
        k[K_P + i], k[K_V + i] = x[i], x[3 + i]
        k[K_R + 4 * i] = 1.0
        K[T_P + i, i] = K[T_V + i, 3 + i] = 1.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LaggedFollower:
    """First-order response to velocity commands."""

    lag: float = 1e15  # s; the default is a constant velocity
    acceleration: float = 1.0  # m/s^2 per sqrt(Hz)

    def theta(self) -> Floats:
        """Kernel parameters, in the order that `propagate` reads them."""
        return np.array([self.lag, self.acceleration])
