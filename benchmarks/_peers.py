"""The same problems in filterpy and stonesoup, at their best: the peers call our compiled models."""

from datetime import datetime, timedelta

import numpy as np

from benchmarks._problems import BEACON, DT, advance, glide, measurements, selector, sense, sightings, start, summary


def filterpy_ekf(n, m, model=advance):
    """ExtendedKalmanFilter with the state and its Jacobian from our model, compiled or not."""
    from filterpy.kalman import ExtendedKalmanFilter

    class Filter(ExtendedKalmanFilter):
        def predict_x(self, u=0):
            model(self.x, self.F)

    def run(events):
        f = Filter(n, m)
        f.x, f.P, f.Q = start(n)
        H, r = selector(n, m)
        f.R, f.F = np.diag(r), np.eye(n)
        for z in measurements(m, events):
            f.predict()
            f.update(z, lambda x: H, lambda x: H @ x)
        return summary(f.x, f.P)

    return run


def stonesoup_ekf(n, m):
    """ExtendedKalmanPredictor and ExtendedKalmanUpdater."""
    from stonesoup.models.base import GaussianModel
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.base import TransitionModel
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor
    from stonesoup.types.array import StateVector
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import ExtendedKalmanUpdater

    x0, P0, Q = start(n)
    _, r = selector(n, m)

    class Model(TransitionModel, GaussianModel):
        ndim_state = n

        def function(self, state, noise=False, **kwargs):
            x = np.array(state.state_vector, float).ravel()
            advance(x, np.eye(n))
            return StateVector(x)

        def jacobian(self, state, **kwargs):
            F = np.eye(n)
            advance(np.array(state.state_vector, float).ravel(), F)
            return F

        def covar(self, **kwargs):
            return Q

        def rvs(self, *args, **kwargs):
            raise NotImplementedError

        def pdf(self, *args, **kwargs):
            raise NotImplementedError

    def run(events):
        predictor = ExtendedKalmanPredictor(Model())
        updater = ExtendedKalmanUpdater(LinearGaussian(n, range(m), np.diag(r)))
        t = datetime(2000, 1, 1)
        state = GaussianState(x0.reshape(-1, 1), P0, timestamp=t)
        for z in measurements(m, events):
            t += timedelta(seconds=DT)
            prior = predictor.predict(state, timestamp=t)
            state = updater.update(SingleHypothesis(prior, Detection(z.reshape(-1, 1), timestamp=t)))
        return summary(np.array(state.state_vector), np.array(state.covar))

    return run


def moved(x, dt):
    """`glide` as filterpy wants it."""
    out = np.empty(6)
    glide(x, dt, out)
    return out


def sensed(x):
    """`sense` as filterpy wants it."""
    out = np.empty(7)
    sense(x, BEACON, out)
    return out


def filterpy_ukf(events):
    """UnscentedKalmanFilter with the same sigma points."""
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    f = UnscentedKalmanFilter(6, 7, DT, sensed, moved, MerweScaledSigmaPoints(6, 1.0, 0.0, 0.0))
    f.x, f.P, f.Q = start(6)
    f.R = np.diag(np.linspace(0.02, 0.05, 7))
    for z in sightings(events):
        f.predict()
        f.update(z)
    return summary(f.x, f.P)


def filterpy_enkf(events):
    """EnsembleKalmanFilter with 900 members."""
    from filterpy.kalman import EnsembleKalmanFilter

    x, P, Q = start(6)
    f = EnsembleKalmanFilter(x, P, 7, DT, 900, sensed, moved)
    f.Q, f.R = Q, np.diag(np.linspace(0.02, 0.05, 7))
    for z in sightings(events):
        f.predict()
        f.update(z)
    return summary(f.x, f.P)
