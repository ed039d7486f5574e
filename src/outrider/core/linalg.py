"""Small dense linear algebra for filters: in place, no allocation, zeros of F and H skipped.

A process Jacobian has three to five non-zeros a row and a measurement Jacobian often one, so testing an entry before a
row operation of n multiplications costs little and saves most of the work, whatever the model.

Some kernels count with unsigned integers: numba tests every signed index for being negative, up to a third of the time.
"""

import numpy as np

from outrider._kernel import kernel
from outrider.typing import Floats, Ints


@kernel
def sandwich(P: Floats, F: Floats, Q: Floats, W: Floats, at: Ints) -> None:
    """P <- F P F' + Q.  P, F, Q (n, n); W (n, n) and at (n, n + 1) are scratch. Only non-zeros of F cost anything.

    First W = F P row by row. Then P = W F' one entry at a time: of (i, j) and (j, i), which are equal, the shorter sum.
    """
    n = np.uint64(P.shape[0])
    non_zeros(F, at)
    times(F, at, P, W)
    for i in range(n):
        for j in range(i + np.uint64(1)):
            s, t = (i, j) if at[i, n] < at[j, n] else (j, i)
            entry = F[s, s] * W[t, s] + Q[i, j]
            for l in range(np.uint64(at[s, n])):
                k = np.uint64(at[s, l])
                entry += F[s, k] * W[t, k]
            P[i, j] = entry
            P[j, i] = entry


@kernel
def non_zeros(F: Floats, at: Ints) -> None:
    """at[i] <- the columns of the non-zeros of F beside the diagonal, and in the last place of the row how many."""
    n = np.uint64(F.shape[0])
    for i in range(n):
        count = np.uint64(0)
        for k in range(n):
            if F[i, k] != 0.0 and k != i:
                at[i, count] = k
                count += np.uint64(1)
        at[i, n] = count


@kernel
def times(F: Floats, at: Ints, P: Floats, W: Floats) -> None:
    """W <- F P, with the non-zeros of F from `non_zeros`: three rows of P at a time, since each pass reads W."""
    n = np.uint64(F.shape[0])
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    for i in range(n):
        d, count = F[i, i], np.uint64(at[i, n])
        for j in range(n):
            W[i, j] = d * P[i, j]
        full = count - count % three
        for l in range(np.uint64(0), full, three):
            p, q, r = np.uint64(at[i, l]), np.uint64(at[i, l + one]), np.uint64(at[i, l + two])
            a, b, c = F[i, p], F[i, q], F[i, r]
            for j in range(n):
                W[i, j] += a * P[p, j] + b * P[q, j] + c * P[r, j]
        for l in range(full, count):
            p = np.uint64(at[i, l])
            a = F[i, p]
            for j in range(n):
                W[i, j] += a * P[p, j]


@kernel
def add_product(sign: float, A: Floats, B: Floats, m: int, M: Floats) -> None:
    """M <- M + sign A' B over the first m rows of A and B, three at a time: rows up to the next three must be zero."""
    n, width = np.uint64(M.shape[0]), np.uint64(M.shape[1])
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    for k in range(np.uint64(0), np.uint64(m), three):
        for i in range(n):
            a, b, c = sign * A[k, i], sign * A[k + one, i], sign * A[k + two, i]
            for j in range(width):
                M[i, j] += a * B[k, j] + b * B[k + one, j] + c * B[k + two, j]


@kernel
def mirror(M: Floats, P: Floats) -> None:
    """P <- the lower triangle of M and its reflection.  P (n, n); M (n, n) or wider.

    A correlation that updates wear away ends as a denormal number, a hundred times as slow: zero below 1e-60.
    """
    n = np.uint64(P.shape[0])
    for i in range(n):
        for j in range(i + np.uint64(1)):
            entry = M[i, j]
            entry = entry if abs(entry) > 1e-60 else 0.0
            P[i, j] = entry
            P[j, i] = entry


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
