"""Kernels of `tacdata.skin.linear.cuda_cg`: operations of conjugate gradients, each field read and written once.

Fields are (3n, batch); ``order`` is the degree of freedom of each row of the rest state's inverse.
A thread does `STRIP` rows of one member, so that its sums go to memory once.
"""

from tacdata.warp_runtime import wp

STRIP = wp.constant(32)
"""Rows a thread."""

_FULL = wp.constant(wp.float32(6.0e4))
"""Near the largest number of half precision."""


@wp.func
def halved(value: wp.float32):
    """Round to half precision, never to infinity."""
    return wp.float16(wp.clamp(value, -_FULL, _FULL))


@wp.kernel(enable_backward=False)
def load(
    r: wp.array2d(dtype=wp.float32),
    order: wp.array(dtype=wp.int32),
    scale: wp.array(dtype=wp.float32),
    size: wp.array(dtype=wp.float32),
    h: wp.array2d(dtype=wp.float16),
):
    """H = the residual, scaled, on the rows of the inverse."""
    k, b = wp.tid()
    h[k, b] = halved(r[order[k], b] * scale[k] * size[b])


@wp.kernel(enable_backward=False)
def reach(
    r: wp.array2d(dtype=wp.float32),
    order: wp.array(dtype=wp.int32),
    scale: wp.array(dtype=wp.float32),
    largest: wp.array(dtype=wp.float32),
):
    """Largest = the largest magnitude of the residual, scaled."""
    strip, b = wp.tid()
    most = wp.float32(0.0)
    for k in range(strip * STRIP, wp.min((strip + 1) * STRIP, order.shape[0])):
        most = wp.max(most, wp.abs(r[order[k], b] * scale[k]))
    wp.atomic_max(largest, b, most)


@wp.kernel(enable_backward=False)
def spread(
    start: wp.array(dtype=wp.int32),
    column: wp.array(dtype=wp.int32),
    value: wp.array(dtype=wp.float32),
    row: wp.array(dtype=wp.int32),
    hard: wp.array2d(dtype=wp.float32),
    soft: wp.array2d(dtype=wp.float32),
    order: wp.array(dtype=wp.int32),
    scale: wp.array(dtype=wp.float32),
    size: wp.array(dtype=wp.float32),
    r: wp.array2d(dtype=wp.float32),
    h: wp.array2d(dtype=wp.float16),
):
    """Take the constraints' forces off the residual.

    Those of hard constraints for good: the preconditioner annihilates them, and the remainder is small. Those of soft
    ones, which the tangent holds too, for this time.
    """
    i, b = wp.tid()
    reaction, correction = wp.float32(0.0), wp.float32(0.0)
    for e in range(start[i], start[i + 1]):
        reaction += value[e] * hard[column[e], b]
        correction += value[e] * soft[column[e], b]
    k = row[i]
    remainder = r[order[k], b] - reaction
    r[order[k], b] = remainder
    h[k, b] = halved((remainder - correction) * scale[k] * size[b])


@wp.kernel(enable_backward=False)
def curve(
    p: wp.array2d(dtype=wp.float32),
    q: wp.array2d(dtype=wp.float32),
    order: wp.array(dtype=wp.int32),
    curvature: wp.array(dtype=wp.float32),
):
    """Curvature += p q."""
    strip, b = wp.tid()
    total = wp.float32(0.0)
    for k in range(strip * STRIP, wp.min((strip + 1) * STRIP, order.shape[0])):
        total += p[order[k], b] * q[order[k], b]
    wp.atomic_add(curvature, b, total)


@wp.kernel(enable_backward=False)
def advance(
    x: wp.array2d(dtype=wp.float32),
    r: wp.array2d(dtype=wp.float32),
    p: wp.array2d(dtype=wp.float32),
    q: wp.array2d(dtype=wp.float32),
    rho: wp.array(dtype=wp.float32),
    curvature: wp.array(dtype=wp.float32),
    going: wp.array(dtype=wp.int32),
    first: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
    scale: wp.array(dtype=wp.float32),
    size: wp.array(dtype=wp.float32),
    h: wp.array2d(dtype=wp.float16),
):
    """Let x += alpha p, r -= alpha q, h = r scaled; at first x = p, as that one keeps the constraints."""
    k, b = wp.tid()
    if going[b] == 1:
        n = order[k]
        alpha = wp.float32(0.0)
        if first[b] == 1:
            alpha = wp.float32(1.0)
        elif curvature[b] > wp.float32(0.0):
            alpha = rho[b] / curvature[b]
        x[n, b] = x[n, b] + alpha * p[n, b]
        residual = r[n, b] - alpha * q[n, b]
        r[n, b] = residual
        h[k, b] = halved(residual * scale[k] * size[b])


@wp.kernel(enable_backward=False)
def measure(
    w: wp.array2d(dtype=wp.float32),
    r: wp.array2d(dtype=wp.float32),
    order: wp.array(dtype=wp.int32),
    scale: wp.array(dtype=wp.float32),
    factor: wp.array(dtype=wp.float32),
    rho: wp.array(dtype=wp.float32),
):
    """Rho += r z, with z = w scaled back."""
    strip, b = wp.tid()
    total = wp.float32(0.0)
    for k in range(strip * STRIP, wp.min((strip + 1) * STRIP, order.shape[0])):
        total += r[order[k], b] * w[k, b] * scale[k]
    wp.atomic_add(rho, b, total * factor[b])


@wp.kernel(enable_backward=False)
def judge(
    rho_new: wp.array(dtype=wp.float32),
    curvature: wp.array(dtype=wp.float32),
    tolerance: wp.array(dtype=wp.float32),
    goal: wp.array(dtype=wp.float32),
    rho: wp.array(dtype=wp.float32),
    beta: wp.array(dtype=wp.float32),
    going: wp.array(dtype=wp.int32),
    first: wp.array(dtype=wp.int32),
):
    """Stop members that are done; clear the sums. The first x sets the scale of small values."""
    b = wp.tid()
    beta[b] = wp.float32(0.0)
    if going[b] == 1:
        if first[b] == 1:
            # At first p is x itself, so p q is its squared energy norm.
            goal[b] = wp.max(curvature[b], wp.float32(0.0)) * tolerance[0] * tolerance[0]
            if rho_new[b] <= goal[b]:
                going[b] = 0
        elif curvature[b] > wp.float32(0.0) and rho_new[b] > goal[b]:
            beta[b] = rho_new[b] / rho[b]
        else:
            going[b] = 0
        rho[b] = rho_new[b]
    first[b] = 0
    rho_new[b] = wp.float32(0.0)
    curvature[b] = wp.float32(0.0)


@wp.kernel(enable_backward=False)
def turn(
    w: wp.array2d(dtype=wp.float32),
    order: wp.array(dtype=wp.int32),
    scale: wp.array(dtype=wp.float32),
    factor: wp.array(dtype=wp.float32),
    beta: wp.array(dtype=wp.float32),
    p: wp.array2d(dtype=wp.float32),
):
    """P = z + beta p."""
    k, b = wp.tid()
    n = order[k]
    p[n, b] = w[k, b] * scale[k] * factor[b] + beta[b] * p[n, b]
