"""Any filter on any process model with any sensor, through the kinematic view.

For studies and comparisons: four verbs (`start`, `predict`, `update`, `moments`), beliefs in, beliefs out, the same for
the extended, the unscented and the ensemble filters. `engine` is the fast way to take a log through the extended one.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeVar, final

import numpy as np
from numpy.random import Generator

from outrider._kernel import kernel
from outrider.core.linalg import chain
from outrider.data.belief import Ensemble, Gaussian, StateLayout
from outrider.filters import ekf, enkf, ukf
from outrider.models.kinematics import K_SIZE, T_SIZE
from outrider.models.motion import LAYOUTS, Motion, kinematic_view, propagate
from outrider.models.sensors import Sensor
from outrider.models.sensors.dispatch import evaluate
from outrider.models.sensors.layout import MAX_ROWS
from outrider.typing import Bools, Floats

B = TypeVar("B", Gaussian, Ensemble)


@kernel
def move_all(code: int, X: Floats, dt: float, u: Floats, theta: Floats, F: Floats, Q: Floats) -> None:
    """X[i] <- f(X[i], u, dt); F and Q are those of the last row."""
    for i in range(X.shape[0]):
        propagate(code, X[i], dt, u, theta, F, Q)


@kernel
def innovate_all(
    code: int, X: Floats, u: Floats, theta: Floats, sensor: int, z: Floats, own: Floats, k: Floats, K: Floats,
    D: Floats, Y: Floats,
) -> int:  # fmt: skip
    """Y[i] <- z [-] h(X[i]); returns the rows of the last; k, K, D are its kinematic view, Jacobian and D."""
    m = 0
    for i in range(X.shape[0]):
        kinematic_view(code, X[i], u, theta, k, K)
        m = evaluate(sensor, k, z, own, Y[i], D)
    return m


class Measurement(NamedTuple):
    """One record: its sensor with parameters theta (THETA_SIZE,), z, and variances r, infinite in rows not used."""

    sensor: Sensor
    theta: Floats
    z: Floats
    r: Floats

    @property
    def used(self) -> Bools:
        """Rows that count."""
        return np.isfinite(self.r)


@final
@dataclass(frozen=True, slots=True)
class Vehicle:
    """A process model with its parameters."""

    motion: Motion
    theta: Floats

    @property
    def layout(self) -> StateLayout:
        """Names of the states."""
        return LAYOUTS[self.motion]

    def moved(self, X: Floats, dt: float, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Members (N, layout.size) after dt, with F and Q (n, n) of the last."""
        n, out = self.layout.error_size, np.array(X, float, order="C")
        F, Q = np.eye(n), np.zeros((n, n))
        move_all(int(self.motion), out, dt, u, self.theta, F, Q)
        return out, F, Q

    def innovations(self, X: Floats, u: Floats, seen: Measurement) -> tuple[Floats, Floats]:
        """Y (N, m) = z [-] h(X) and H (m, n) of the last member, rows that count only; m is 0 where nothing is seen."""
        k, K, D = np.zeros(K_SIZE), np.zeros((T_SIZE, self.layout.error_size)), np.zeros((MAX_ROWS, T_SIZE))
        Y, H = np.zeros((X.shape[0], MAX_ROWS)), np.zeros((MAX_ROWS, self.layout.error_size))
        members = np.array(X, float, order="C")
        m = innovate_all(int(self.motion), members, u, self.theta, int(seen.sensor), seen.z, seen.theta, k, K, D, Y)
        chain(D, K, m, H)
        rows = np.flatnonzero(seen.used[:m])
        return np.ascontiguousarray(Y[:, rows]), np.ascontiguousarray(H[rows])


class Updated(NamedTuple):
    """A belief after a measurement of `dof` rows; nis is NaN where nothing was seen."""

    belief: Gaussian | Ensemble
    nis: float
    dof: int


class Estimator(Protocol[B]):
    """What all filters can do. u (6,) is the input, as the process model reads it."""

    def start(self, belief: Gaussian) -> B:
        """The filter's own kind of belief."""
        ...

    def predict(self, v: Vehicle, belief: B, dt: float, u: Floats) -> B:
        """The belief after dt."""
        ...

    def update(self, v: Vehicle, belief: B, u: Floats, seen: Measurement) -> Updated:
        """The belief after a measurement."""
        ...

    def moments(self, belief: B) -> Gaussian:
        """Mean and covariance."""
        ...


@final
@dataclass(frozen=True, slots=True)
class Extended:
    """The extended Kalman filter."""

    def start(self, belief: Gaussian) -> Gaussian:
        return belief

    def predict(self, v: Vehicle, belief: Gaussian, dt: float, u: Floats) -> Gaussian:
        X, F, Q = v.moved(belief.x[None], dt, u)
        return ekf.predict(belief, X[0], F, Q)

    def update(self, v: Vehicle, belief: Gaussian, u: Floats, seen: Measurement) -> Updated:
        Y, H = v.innovations(belief.x[None], u, seen)
        if Y.shape[1] == 0:
            return Updated(belief, np.nan, 0)
        done = ekf.update(belief, Y[0], H, seen.r[seen.used])
        return Updated(done.belief, done.nis, Y.shape[1])

    def moments(self, belief: Gaussian) -> Gaussian:
        return belief


@final
@dataclass(frozen=True, slots=True)
class Unscented:
    """The unscented Kalman filter. The noise of a step is that at the mean."""

    spread: ukf.Spread = ukf.CUBATURE

    def start(self, belief: Gaussian) -> Gaussian:
        return belief

    def predict(self, v: Vehicle, belief: Gaussian, dt: float, u: Floats) -> Gaussian:
        Q = v.moved(belief.x[None], dt, u)[2]
        return ukf.predict(belief, lambda x, h: v.moved(x[None], h, u)[0][0], dt, Q, spread=self.spread).belief

    def update(self, v: Vehicle, belief: Gaussian, u: Floats, seen: Measurement) -> Updated:
        dof = v.innovations(belief.x[None], u, seen)[0].shape[1]
        if dof == 0:
            return Updated(belief, np.nan, 0)
        r = seen.r[seen.used]
        done = ukf.update(belief, lambda x: v.innovations(x[None], u, seen)[0][0], r, spread=self.spread)
        return Updated(done.belief, done.nis, dof)

    def moments(self, belief: Gaussian) -> Gaussian:
        return belief


@final
@dataclass(frozen=True, slots=True)
class EnsembleKalman:
    """The ensemble Kalman filter: stochastic, or the ensemble transform with `square_root`.

    An update is a regression on N members. By chance every state is correlated with the measurement, which makes its
    variance too small by a share of d / N and its mean worse by as much, d = trace(H P H' S^-1). Variances are
    therefore widened by 1 + 2 d / N (`correction`), or an ensemble of hundreds is over-confident after some updates.
    """

    members: int
    rng: Generator
    square_root: bool = False
    correction: bool = True

    def start(self, belief: Gaussian) -> Ensemble:
        return enkf.sample(belief, self.members, self.rng)

    def predict(self, v: Vehicle, belief: Ensemble, dt: float, u: Floats) -> Ensemble:
        Q = v.moved(enkf.moments(belief)[0].x[None], dt, u)[2]
        return enkf.predict(belief, lambda X, h: v.moved(X, h, u)[0], dt, Q, self.rng)

    def update(self, v: Vehicle, belief: Ensemble, u: Floats, seen: Measurement) -> Updated:
        dof = v.innovations(belief.X[:1], u, seen)[0].shape[1]
        if dof == 0:
            return Updated(belief, np.nan, 0)
        r = seen.r[seen.used]

        def residual(X: Floats) -> Floats:
            return v.innovations(X, u, seen)[0]

        if self.square_root:
            done = enkf.update_square_root(belief, residual, r)
        else:
            done = enkf.update(belief, residual, r, self.rng)
        if not self.correction:
            return Updated(done.belief, done.nis, dof)
        d = dof - float(np.linalg.inv(done.S).diagonal() @ r)
        return Updated(inflated(done.belief, float(np.sqrt(1.0 + 2.0 * d / self.members))), done.nis, dof)

    def moments(self, belief: Ensemble) -> Gaussian:
        return enkf.moments(belief)[0]


def inflated(belief: Ensemble, factor: float) -> Ensemble:
    """The ensemble with all distances from its mean multiplied."""
    mean, E = enkf.moments(belief)
    X = np.repeat(mean.x[None], belief.X.shape[0], axis=0)
    enkf.perturb(X, factor * E, belief.layout.table)
    return Ensemble(X, belief.layout)
