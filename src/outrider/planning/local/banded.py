"""Symmetric positive definite systems of half-bandwidth 11, columns below the diagonal: B[j, k] = A[j + k, j]."""

from math import sqrt
from typing import Final

from outrider._kernel import kernel
from outrider.typing import Floats

BAND: Final = 12  # entries of a column, the diagonal included


@kernel
def factor(B: Floats, n: int) -> bool:
    """B <- its Cholesky factor L, A = L L'; False when A is not positive definite. B has BAND spare rows."""
    for j in range(n):
        pivot = B[j, 0]
        if not pivot > 0.0:
            return False
        root = 1.0 / sqrt(pivot)
        for k in range(BAND):
            B[j, k] *= root
        for k in range(1, BAND):
            a = B[j, k]
            if a != 0.0:
                for m in range(BAND - k):
                    B[j + k, m] -= a * B[j, k + m]
    return True


@kernel
def solve(L: Floats, n: int, x: Floats) -> None:
    """x <- A^-1 x with the factor L. x has BAND spare places."""
    for j in range(n):
        y = x[j] / L[j, 0]
        x[j] = y
        for k in range(1, BAND):
            x[j + k] -= L[j, k] * y
    for k in range(BAND):
        x[n + k] = 0.0
    for j in range(n - 1, -1, -1):
        y = x[j]
        for k in range(1, BAND):
            y -= L[j, k] * x[j + k]
        x[j] = y / L[j, 0]
