"""State layouts and beliefs: what a filter knows, with every component named once."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import final

import numpy as np

from outrider.errors import ConfigError
from outrider.typing import Floats, Ints


class Manifold(IntEnum):
    """How a block of the state is corrected: x [+] dx."""

    VECTOR = 0  # x + dx, size as given
    ANGLE = 1  # wrap(x + dx), one number
    ROTATION = 2  # q (x) Exp(dx): four numbers x y z w, three in the error
    STRETCH = 3  # of a vector by a scale, see `core.manifold`; a relation between blocks, no block itself


@final
@dataclass(frozen=True, slots=True)
class Block:
    """One named block: `state` slices the nominal state, `error` slices the error state and the covariance."""

    name: str
    manifold: Manifold
    state: slice
    error: slice
    unit: str


@final
class StateLayout:
    """Names every component of a state once; arrays are sliced by name.

    The nominal state x holds quaternions, the error state dx holds rotation vectors in the body frame (right
    perturbation, R = R_hat Exp(dx)), so the two may differ in length.
    """

    def __init__(self, *blocks: tuple[str, int | Manifold, str], stretches: tuple[tuple[str, str], ...] = ()) -> None:
        """Each block is (name, size or manifold, unit); a size means a plain vector.

        stretches : (vector, scale) pairs of blocks that come before any rotation.
        """
        self.blocks: dict[str, Block] = {}
        i = k = 0
        for name, what, unit in blocks:
            manifold = what if isinstance(what, Manifold) else Manifold.VECTOR
            n_state = {Manifold.ANGLE: 1, Manifold.ROTATION: 4}.get(manifold, int(what))
            n_error = 3 if manifold is Manifold.ROTATION else n_state
            self.blocks[name] = Block(name, manifold, slice(i, i + n_state), slice(k, k + n_error), unit)
            i, k = i + n_state, k + n_error
        self.size, self.error_size, self.stretches = i, k, stretches

    def __repr__(self) -> str:
        return f"StateLayout({', '.join(self.blocks)}: {self.size} numbers, {self.error_size} errors)"

    def __iter__(self) -> Iterator[Block]:
        return iter(self.blocks.values())

    def __contains__(self, name: str) -> bool:
        return name in self.blocks

    def state(self, name: str) -> slice:
        """Where a block stands in the nominal state."""
        return self._block(name).state

    def error(self, name: str) -> slice:
        """Where a block stands in the error state, and so in the covariance."""
        return self._block(name).error

    def _block(self, name: str) -> Block:
        if name not in self.blocks:
            raise ConfigError(f"no state '{name}'", fix=f"the states are {', '.join(self.blocks)}")
        return self.blocks[name]

    @cached_property
    def table(self) -> Ints:
        """(rows, 4) int64 for kernels: manifold, first state index, first error index, error size.

        A row for each block; vectors that follow each other are one.
        """
        rows: list[list[int]] = []
        for b in self:
            size = b.error.stop - b.error.start
            if rows and rows[-1][0] == b.manifold == Manifold.VECTOR:
                rows[-1][3] += size
            else:
                rows.append([int(b.manifold), b.state.start, b.error.start, size])
        for vector, scale in self.stretches:
            v, s = self.error(vector), self.error(scale)
            rows.append([int(Manifold.STRETCH), v.start, s.start, v.stop - v.start])
        return np.array(rows, np.int64).reshape(-1, 4)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """One name per error component, e.g. `position_x`."""
        out: list[str] = []
        for b in self:
            size = b.error.stop - b.error.start
            out += [b.name] if size == 1 else [f"{b.name}_{'xyzabcdefgh'[i]}" for i in range(size)]
        return tuple(out)

    @property
    def angles(self) -> Ints:
        """Error rows that are angles [rad]."""
        rows = [np.arange(b.error.start, b.error.stop) for b in self if b.manifold is not Manifold.VECTOR]
        return np.concatenate(rows).astype(np.int64) if rows else np.zeros(0, np.int64)

    def zeros(self) -> Floats:
        """The nominal state with all vectors and angles zero and all rotations the identity."""
        x = np.zeros(self.size)
        for b in self:
            if b.manifold is Manifold.ROTATION:
                x[b.state.stop - 1] = 1.0
        return x


@final
@dataclass(frozen=True, slots=True)
class Gaussian:
    """Mean and covariance on a manifold: x (layout.size,), P (layout.error_size, layout.error_size) of the error."""

    x: Floats
    P: Floats
    layout: StateLayout

    def std(self, name: str) -> Floats:
        """Standard deviations of one block, of a stretched vector with what its scale adds."""
        s, P = self.layout.error(name), self.P
        rows = np.eye(len(P))[s]
        for vector, scale in self.layout.stretches:
            if vector == name:
                k = self.layout.error(scale).start
                rows *= 1.0 + self.x[k]
                rows[:, k] = self.x[self.layout.state(name)] / (1.0 + self.x[k])
        return np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", rows, P, rows), 0.0))


@final
@dataclass(frozen=True, slots=True)
class Ensemble:
    """A belief as members: X (members, layout.size)."""

    X: Floats
    layout: StateLayout
