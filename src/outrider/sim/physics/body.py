"""The one place that knows MuJoCo: a model, its state as an array, one step after the other."""

from functools import cached_property
from typing import Any, final

import numpy as np

from outrider.core.rotations import quats_to_matrices
from outrider.errors import ConfigError
from outrider.models.vehicles.base import ROW_F, ROW_P, ROW_Q, ROW_SIZE, ROW_V, ROW_W
from outrider.typing import Floats


def library() -> Any:
    """The `mujoco` module, untyped."""
    try:
        import mujoco
    except ImportError:
        raise ConfigError("MuJoCo is not installed", fix="pip install 'outrider[physics]'") from None
    return mujoco


@final
class MujocoBody:
    """A free body with whatever hangs on it. Its first seven coordinates are x y z and w x y z of the body."""

    def __init__(self, xml: str) -> None:
        self._m = library()
        self.model: Any = self._m.MjModel.from_xml_string(xml)
        self.data: Any = self._m.MjData(self.model)

    @cached_property
    def _kind(self) -> int:
        return int(self._m.mjtState.mjSTATE_INTEGRATION)

    @property
    def width(self) -> int:
        """Numbers of a whole state."""
        return int(self._m.mj_stateSize(self.model, self._kind))

    def load(self, x: Floats) -> None:
        """Make x (width,) the present state."""
        self._m.mj_setState(self.model, self.data, x, self._kind)
        self._m.mj_forward(self.model, self.data)

    def store(self, x: Floats) -> None:
        """Write the present state into x (width,)."""
        self._m.mj_getState(self.model, self.data, x, self._kind)

    def rest(self, p: Floats, q: Floats) -> Floats:
        """The state at rest at p (3,) m, q (4,) x y z w."""
        self._m.mj_resetData(self.model, self.data)
        self.data.qpos[:3], self.data.qpos[3], self.data.qpos[4:7] = p, q[3], q[:3]
        self._m.mj_forward(self.model, self.data)
        x = np.zeros(self.width)
        self.store(x)
        return x

    @property
    def p(self) -> Floats:
        """(3,) m."""
        return np.array(self.data.qpos[:3])

    @property
    def q(self) -> Floats:
        """(4,) x y z w."""
        w, x, y, z = self.data.qpos[3:7]
        return np.array([x, y, z, w])

    @property
    def v(self) -> Floats:
        """(3,) m/s in the world."""
        return np.array(self.data.qvel[:3])

    @property
    def w(self) -> Floats:
        """(3,) rad/s in the body."""
        return np.array(self.data.qvel[3:6])

    def step(self, gravity: float, row: Floats) -> None:
        """One step, told in a row (16,): the specific force is the mean over the step."""
        before = self.v
        self._m.mj_step(self.model, self.data)
        q, v = self.q, self.v
        a = (v - before) / self.model.opt.timestep + np.array([0.0, 0.0, gravity])
        row[ROW_P:ROW_Q], row[ROW_Q:ROW_V], row[ROW_V:ROW_W], row[ROW_W:ROW_F] = self.p, q, v, self.w
        row[ROW_F:ROW_SIZE] = quats_to_matrices(q[None])[0].T @ a
