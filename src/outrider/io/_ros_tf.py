"""Where sensors sit, as far as a recording's transforms tell: links that never move, composed over the tree."""

from collections.abc import Iterator
from typing import Any, final

import numpy as np

from outrider.core.attitudes import quats_to_matrices
from outrider.typing import Floats

WHOLE = 1000  # this many messages of moving /tf are all looked at, of the rest
EVERY = 20  # one in so many: a link that has not moved by then is a mount
_STILL = 1e-9
_BASES = ("base_link", "base_footprint")
_NOT_BODY = ("map", "odom", "world", "earth")  # a link below one of these is a motion, even if it never moves


@final
class Links:
    """Collects transforms parent <- child and drops those that change."""

    def __init__(self) -> None:
        self._fixed: dict[str, tuple[str, Floats]] = {}
        self._moving: set[str] = set()
        self._seen = 0

    def wants_next(self) -> bool:
        """Whether the next message of a moving /tf is worth decoding."""
        self._seen += 1
        return self._seen <= WHOLE or self._seen % EVERY == 0

    def add(self, message: Any) -> None:
        """A decoded tf2_msgs/TFMessage."""
        for link in message.transforms:
            child, parent = link.child_frame_id.lstrip("/"), link.header.frame_id.lstrip("/")
            if child in self._moving:
                continue
            p, q = link.transform.translation, link.transform.rotation
            T = _matrix(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))
            known_parent, known = self._fixed.get(child, (parent, T))
            same = known_parent == parent and np.allclose(known, T, rtol=0, atol=_STILL)
            if same and np.isfinite(T).all() and _last(parent) not in _NOT_BODY:
                self._fixed[child] = parent, T
            else:
                self._moving.add(child)
                self._fixed.pop(child, None)

    def mounts(self) -> dict[str, Floats]:
        """(4, 4) base <- frame for each frame of a tree; base_link, else base_footprint, else the root is base."""
        to_root = {frame: self._to_root(frame) for frame in sorted({*self._fixed, *self._parents()})}
        bases = {
            root: self._base([f for f, (r, _) in to_root.items() if r == root], root) for root, _ in to_root.values()
        }
        return {
            frame: np.linalg.inv(to_root[bases[root]][1]) @ T
            for frame, (root, T) in to_root.items()
            if frame != bases[root]
        }

    def _parents(self) -> Iterator[str]:
        return (parent for parent, _ in self._fixed.values())

    def _to_root(self, frame: str) -> tuple[str, Floats]:
        chain, seen = [np.eye(4)], {frame}
        while frame in self._fixed and self._fixed[frame][0] not in seen:
            frame, link = self._fixed[frame]
            seen.add(frame)
            chain.append(link @ chain[-1])
        return frame, chain[-1]

    @staticmethod
    def _base(frames: list[str], root: str) -> str:
        return next((f for name in _BASES for f in frames if _last(f) == name), root)


def _last(frame: str) -> str:
    return frame.rsplit("/", 1)[-1]


def _matrix(p: Floats, q: Floats) -> Floats:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = quats_to_matrices(q), p
    return T
