"""Small dense linear algebra for filters: in place, no allocation, zeros of F and H skipped.

A process Jacobian has three to five non-zeros a row and a measurement Jacobian often one, so testing an entry before a
row operation of n multiplications costs little and saves most of the work, whatever the model.

Some kernels count with unsigned integers: numba tests every signed index for being negative, up to a third of the time.
"""

from math import sqrt

import numpy as np

from outrider._kernel import inlined, kernel
from outrider.typing import Floats, Ints


@inlined
def sandwich(P: Floats, F: Floats, Q: Floats, W: Floats, seen: Floats, at: Ints, d: Floats) -> None:
    """P <- F P F' + Q.  P, F, Q, W (n, n); at (n, n + 1); d (n,). Only non-zeros of F cost anything.

    W, seen, at and d are scratch; `seen` and `at` hold the pattern of the last F, which is mostly that of the next.
    First W = F P row by row, then P = W F' in rows too, as if F were diagonal. What is missing are the columns of rows
    of F with more than that: one entry at a time, and their reflections.
    """
    n = np.uint64(P.shape[0])
    if differs(F, seen):
        non_zeros(F, seen, at)
    for i in range(n):
        d[i] = F[i, i]
    times(F, at, P, W)
    for i in range(n):
        for j in range(n):
            P[i, j] = d[j] * W[i, j] + Q[i, j]
    for s in range(n):
        count = np.uint64(at[s, n])
        for t in range(s + np.uint64(1)):
            if at[t, n] == 0:
                P[t, s] = P[s, t]
            elif count == np.uint64(0):
                P[s, t] = P[t, s]
            else:
                entry = P[t, s]
                for l in range(count):
                    k = np.uint64(at[s, l])
                    entry += F[s, k] * W[t, k]
                P[t, s] = P[s, t] = entry


@inlined
def differs(F: Floats, seen: Floats) -> bool:
    """Whether F (n, n) has its non-zeros elsewhere than `seen`."""
    here, before = F.reshape(F.size), seen.reshape(seen.size)
    count = 0
    for i in range(np.uint64(here.size)):
        count += (here[i] != 0.0) != (before[i] != 0.0)
    return count != 0


@kernel
def non_zeros(F: Floats, seen: Floats, at: Ints) -> None:
    """seen <- 1 where F is not zero, else 0; at[i] <- those columns beside the diagonal, in its last place how many."""
    n = F.shape[0]
    for i in range(n):
        count = 0
        for k in range(n):
            seen[i, k] = 1.0 if F[i, k] != 0.0 else 0.0
            if F[i, k] != 0.0 and k != i:
                at[i, count] = k
                count += 1
        at[i, n] = count


@inlined
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


@inlined
def add_product(sign: float, A: Floats, B: Floats, m: int, M: Floats) -> None:
    """M <- M + sign A' B over the first m rows of A and B, six at a time: rows up to the next six must be zero."""
    n, width = np.uint64(M.shape[0]), np.uint64(M.shape[1])
    one, two, three, four, five, six = (
        np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4), np.uint64(5), np.uint64(6),
    )  # fmt: skip
    for k in range(np.uint64(0), np.uint64(m), six):
        for i in range(n):
            a, b, c = sign * A[k, i], sign * A[k + one, i], sign * A[k + two, i]
            d, e, f = sign * A[k + three, i], sign * A[k + four, i], sign * A[k + five, i]
            for j in range(width):
                M[i, j] += (
                    (a * B[k, j] + b * B[k + one, j] + c * B[k + two, j])
                    + (d * B[k + three, j] + e * B[k + four, j] + f * B[k + five, j])
                )  # fmt: skip


@inlined
def mirror(M: Floats, P: Floats) -> None:
    """P <- the symmetric part of M.  P (n, n); M (n, n) or wider.

    A correlation that updates wear away ends as a denormal number, a hundred times as slow: zero below 1e-60.
    """
    n = np.uint64(P.shape[0])
    for i in range(n):
        for j in range(i + np.uint64(1)):
            entry = 0.5 * (M[i, j] + M[j, i])
            entry = entry if abs(entry) > 1e-60 else 0.0
            P[i, j] = entry
            P[j, i] = entry


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
def cholesky(A: Floats, m: int, L: Floats) -> bool:
    """L L' = A for the leading (m, m) block, L lower triangular; False when A is not positive definite."""
    for j in range(m):
        d = A[j, j]
        for k in range(j):
            d -= L[j, k] * L[j, k]
        if not d > 0.0:
            return False
        root = sqrt(d)
        L[j, j] = root
        share = 1.0 / root
        for i in range(j + 1, m):
            s = A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = s * share
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
