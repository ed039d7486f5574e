"""What process models with an attitude share: the matrix of a state's quaternion, and the Jacobians of turning it."""

from typing import TypeAlias

from outrider._kernel import kernel
from outrider.core.rotations import sines, skew_block
from outrider.typing import Floats

Matrix: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]


@kernel
def rotation(x: Floats, i: int) -> Matrix:
    """Rotation matrix, row-major, of the quaternion x[i:i+4]."""
    a, b, c, d = x[i], x[i + 1], x[i + 2], x[i + 3]
    return (
        1 - 2 * (b * b + c * c), 2 * (a * b - c * d), 2 * (a * c + b * d),
        2 * (a * b + c * d), 1 - 2 * (a * a + c * c), 2 * (b * c - a * d),
        2 * (a * c - b * d), 2 * (b * c + a * d), 1 - 2 * (a * a + b * b),
    )  # fmt: skip


@kernel
def turn(F: Floats, row: int, column: int, p0: float, p1: float, p2: float, scale: float) -> None:
    """Jacobians of R' = R Exp(p), exact for any p: dth' = Exp(-p) dth + Jr(p) dp, where dp = scale times the column.

    row : first of the attitude's error rows;  column : first of those that p depends on (rate, or the gyro's bias)
    """
    s, b, c = sines(p0 * p0 + p1 * p1 + p2 * p2)
    skew_block(p0, p1, p2, 1.0, -s, b, F, row, row)
    skew_block(p0, p1, p2, scale, -scale * b, scale * c, F, row, column)


@kernel
def swing(F: Floats, i: int, j: int, scale: float, a0: float, a1: float, a2: float, R: Matrix) -> None:
    """F[i:i+3, j:j+3] = -scale [a]x R: how the world vector scale a moves when its body turns by dth on the right."""
    for k in range(3):
        F[i, j + k] = scale * (a2 * R[3 + k] - a1 * R[6 + k])
        F[i + 1, j + k] = scale * (a0 * R[6 + k] - a2 * R[k])
        F[i + 2, j + k] = scale * (a1 * R[k] - a0 * R[3 + k])
