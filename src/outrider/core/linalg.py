"""Small dense linear algebra for filters: in place, no allocation, zeros of F and H skipped.

A process Jacobian has three to five non-zeros a row and a measurement Jacobian often one, so testing an entry before a
row operation of n multiplications costs little and saves most of the work, whatever the model.
"""

from outrider._kernel import kernel
from outrider.typing import Floats


@kernel
def sandwich(P: Floats, F: Floats, Q: Floats, W: Floats) -> None:
    """P <- F P F' + Q.  P, F, Q, W (n, n); W is scratch. Only rows of F that differ from the identity cost anything."""
    n = P.shape[0]
    for i in range(n):  # W = F P, row by row
        first = True
        for k in range(n):
            f = F[i, k]
            if f != 0.0:
                if first:
                    for j in range(n):
                        W[i, j] = f * P[k, j]
                    first = False
                else:
                    for j in range(n):
                        W[i, j] += f * P[k, j]
        if first:
            for j in range(n):
                W[i, j] = 0.0
    for i in range(n):  # P' = F W', and P is symmetric
        first = True
        for k in range(n):
            f = F[i, k]
            if f != 0.0:
                if first:
                    for j in range(n):
                        P[i, j] = f * W[j, k]
                    first = False
                else:
                    for j in range(n):
                        P[i, j] += f * W[j, k]
        if first:
            for j in range(n):
                P[i, j] = 0.0
    for i in range(n):
        P[i, i] += Q[i, i]
        for j in range(i):
            mean = 0.5 * (P[i, j] + P[j, i]) + Q[i, j]
            # A correlation that updates wear away ends as a denormal number, and those cost a hundred times more.
            mean = mean if abs(mean) > 1e-60 else 0.0
            P[i, j] = mean
            P[j, i] = mean


@kernel
def times_transpose(H: Floats, P: Floats, m: int, HP: Floats) -> None:
    """HP <- H P for the first m rows.  H (m, n), P (n, n) symmetric, HP (m, n)."""
    n = P.shape[0]
    for i in range(m):
        first = True
        for k in range(n):
            h = H[i, k]
            if h != 0.0:
                if first:
                    for j in range(n):
                        HP[i, j] = h * P[k, j]
                    first = False
                else:
                    for j in range(n):
                        HP[i, j] += h * P[k, j]
        if first:
            for j in range(n):
                HP[i, j] = 0.0


@kernel
def chain(D: Floats, K: Floats, m: int, H: Floats) -> None:
    """H <- D K for the first m rows: the chain rule.  D (m, t), K (t, n), H (m, n)."""
    t, n = K.shape
    for i in range(m):
        for j in range(n):
            H[i, j] = 0.0
        for k in range(t):
            d = D[i, k]
            if d != 0.0:
                for j in range(n):
                    H[i, j] += d * K[k, j]


@kernel
def innovation_covariance(HP: Floats, H: Floats, r: Floats, m: int, S: Floats) -> None:
    """S <- H P H' + diag(r) for the first m rows.  r (m,) variances."""
    n = H.shape[1]
    for i in range(m):
        for j in range(i + 1):
            S[i, j] = 0.0
        for k in range(n):
            h = H[i, k]
            if h != 0.0:
                for j in range(i + 1):
                    S[i, j] += h * HP[j, k]
        S[i, i] += r[i]
    for i in range(m):
        for j in range(i + 1, m):
            S[i, j] = S[j, i]


@kernel
def cholesky(A: Floats, m: int, L: Floats) -> bool:
    """L L' = A for the leading (m, m) block, L lower triangular; False when A is not positive definite."""
    for j in range(m):
        d = A[j, j]
        for k in range(j):
            d -= L[j, k] * L[j, k]
        if not d > 0.0:
            return False
        root = d**0.5
        L[j, j] = root
        for i in range(j + 1, m):
            s = A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = s / root
        for i in range(j):
            L[i, j] = 0.0
    return True


@kernel
def solve_lower(L: Floats, m: int, b: Floats) -> None:
    """b <- L^-1 b for the leading (m, m) block."""
    for i in range(m):
        s = b[i]
        for k in range(i):
            s -= L[i, k] * b[k]
        b[i] = s / L[i, i]


@kernel
def solve_lower_rows(L: Floats, m: int, B: Floats) -> None:
    """B <- L^-1 B for the first m rows of B (m, n)."""
    n = B.shape[1]
    for i in range(m):
        for k in range(i):
            c = L[i, k]
            if c != 0.0:
                for j in range(n):
                    B[i, j] -= c * B[k, j]
        d = 1.0 / L[i, i]
        for j in range(n):
            B[i, j] *= d


@kernel
def solve_upper_rows(L: Floats, m: int, B: Floats) -> None:
    """B <- L^-T B for the first m rows of B (m, n)."""
    n = B.shape[1]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            c = L[k, i]
            if c != 0.0:
                for j in range(n):
                    B[i, j] -= c * B[k, j]
        d = 1.0 / L[i, i]
        for j in range(n):
            B[i, j] *= d


@kernel
def all_finite(a: Floats) -> bool:
    """Whether a vector holds neither NaN nor infinity."""
    total = 0.0
    for i in range(a.size):
        total += 0.0 * a[i]
    return total == 0.0


@kernel
def copy(a: Floats, out: Floats) -> None:
    """out <- a, vectors or matrices of one shape."""
    flat, to = a.reshape(a.size), out.reshape(out.size)
    for i in range(flat.size):
        to[i] = flat[i]
