"""The Warp kernel that finds the height of deformed quadratic triangles above sample points.

One thread takes one triangle of one state. Seen from above, a quadratic triangle is the map

    x(xi, eta) = a + b xi + c eta + d xi^2 + e xi eta + f eta^2

For every sample under its Bezier hull, Newton's method solves x(xi, eta) = sample. The greatest height wins (a
z-buffer), so that of several sheets the uppermost is kept. A second pass reads at these heights how far the face
touches there. A triangle whose Jacobian determinant keeps its sign holds a
sample at most once. Where it does not, or where the triangle bends strongly, the search starts from 16 places.
"""

from __future__ import annotations

from tacdata.warp_runtime import ON_CPU, wp

NOTHING = wp.constant(-1.0e30)
"""Height of a sample without a triangle [mm]."""


@wp.func
def _cross(a: wp.vec2d, b: wp.vec2d):
    return a[0] * b[1] - a[1] * b[0]


@wp.func
def _flat(a: wp.vec3d):
    return wp.vec2d(a[0], a[1])


@wp.func
def _position(nodes: wp.array(dtype=wp.vec3d), u: wp.array3d(dtype=wp.float64), node: wp.int32, state: wp.int32):
    return nodes[node] + wp.vec3d(u[node, 0, state], u[node, 1, state], u[node, 2, state])


@wp.func
def _first_at_least(values: wp.array(dtype=wp.float64), bound: wp.float64):
    """Number of the first of ascending values that is not below a bound."""
    low = wp.int32(0)
    high = values.shape[0]
    while low < high:
        middle = (low + high) // 2
        if values[middle] < bound:
            low = middle + 1
        else:
            high = middle
    return low


@wp.func
def _jacobian(b: wp.vec2d, c: wp.vec2d, d: wp.vec2d, e: wp.vec2d, f: wp.vec2d, xi: wp.float64, eta: wp.float64):
    two = wp.float64(2.0)
    return _cross(b + two * xi * d + eta * e, c + xi * e + two * eta * f)


@wp.func
def _search(
    a: wp.vec2d, b: wp.vec2d, c: wp.vec2d, d: wp.vec2d, e: wp.vec2d, f: wp.vec2d, target: wp.vec2d, start: wp.vec2d
):
    """Newton's method: (xi, eta, 1 if the sample is in the triangle, 0 if not, -1 if no point was found)."""
    two, far, close = wp.float64(2.0), wp.float64(0.7), wp.float64(1.0e-12)
    xi, eta = start[0], start[1]
    local = wp.float64(-1.0)
    for _step in range(40):
        remainder = target - (a + xi * b + eta * c + xi * xi * d + xi * eta * e + eta * eta * f)
        s, t = b + two * xi * d + eta * e, c + xi * e + two * eta * f
        determinant = _cross(s, t)
        if wp.abs(determinant) < wp.float64(1.0e-14):
            determinant = wp.float64(1.0e-14)
        dxi, deta = _cross(remainder, t) / determinant, _cross(s, remainder) / determinant
        size = wp.length(wp.vec2d(dxi, deta))
        if size > far:
            dxi, deta = dxi * far / size, deta * far / size
        xi, eta = xi + dxi, eta + deta
        if size < close:
            local = wp.float64(0.0)
            break
    edge = wp.float64(-1.0e-9)
    if local == wp.float64(0.0) and xi > edge and eta > edge and wp.float64(1.0) - xi - eta > edge:
        local = wp.float64(1.0)
    return wp.vec3d(xi, eta, local)


@wp.func
def _height(p: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d, e: wp.vec3d, f: wp.vec3d, local: wp.vec3d):
    xi, eta = local[0], local[1]
    return p[2] + xi * b[2] + eta * c[2] + xi * xi * d[2] + xi * eta * e[2] + eta * eta * f[2]


@wp.func
def _center(k: wp.int32):
    """Centre of one of the 16 triangles that halving all edges twice gives, (xi, eta)."""
    row = wp.int32(0)
    place = k
    for _above_row in range(3):
        if place >= 7 - 2 * row:
            place = place - (7 - 2 * row)
            row = row + 1
    flipped = place % 2
    third = wp.float64(1.0 / 12.0)
    return wp.vec2d(wp.float64(3 * (place // 2) + 1 + flipped) * third, wp.float64(3 * row + 1 + flipped) * third)


@wp.func
def _above(
    target: wp.vec2d,
    p: wp.vec3d,
    b: wp.vec3d,
    c: wp.vec3d,
    d: wp.vec3d,
    e: wp.vec3d,
    f: wp.vec3d,
    inverse: wp.mat22d,
    mild: bool,
):
    """Greatest height of one triangle above a sample, or NOTHING, after the (xi, eta) where it has it."""
    a2, b2, c2, d2, e2, f2 = _flat(p), _flat(b), _flat(c), _flat(d), _flat(e), _flat(f)
    best = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(NOTHING))
    many = not mild
    if mild:
        local = _search(a2, b2, c2, d2, e2, f2, target, inverse * (target - a2))
        if local[2] > wp.float64(0.0):
            best = wp.vec3d(local[0], local[1], _height(p, b, c, d, e, f, local))
        many = local[2] < wp.float64(0.0)
    if many:
        for k in range(16):
            local = _search(a2, b2, c2, d2, e2, f2, target, _center(k))
            if local[2] > wp.float64(0.0):
                z = _height(p, b, c, d, e, f, local)
                if z > best[2]:
                    best = wp.vec3d(local[0], local[1], z)
    return best


@wp.func
def _middle_hat(at_a: wp.float64, at_b: wp.float64, at_c: wp.float64):
    """Hat of the node between two corners, by the barycentric coordinates of these and of the third."""
    two, value = wp.float64(2.0), wp.max(wp.float64(1.0) - wp.float64(2.0) * at_c, wp.float64(0.0))
    if wp.max(at_a, at_b) > wp.float64(0.5):
        value = two * wp.min(at_a, at_b)
    return value


@wp.func
def _of_touching(marks: wp.array2d(dtype=wp.float64), faces: wp.array2d(dtype=wp.int32), f: int, s: int, at: wp.vec3d):
    """Sum of the hats of a face's marked nodes at (xi, eta), by their marks."""
    one, two, zero = wp.float64(1.0), wp.float64(2.0), wp.float64(0.0)
    b1, b2 = at[0], at[1]
    b0 = one - b1 - b2
    total = marks[faces[f, 0], s] * wp.max(two * b0 - one, zero)
    total += marks[faces[f, 1], s] * wp.max(two * b1 - one, zero)
    total += marks[faces[f, 2], s] * wp.max(two * b2 - one, zero)
    total += marks[faces[f, 3], s] * _middle_hat(b0, b1, b2)
    total += marks[faces[f, 4], s] * _middle_hat(b1, b2, b0)
    total += marks[faces[f, 5], s] * _middle_hat(b2, b0, b1)
    return total


def _highest(
    nodes: wp.array(dtype=wp.vec3d),
    faces: wp.array2d(dtype=wp.int32),
    u: wp.array3d(dtype=wp.float64),
    xs: wp.array(dtype=wp.float64),
    ys: wp.array(dtype=wp.float64),
    height: wp.array3d(dtype=wp.float64),
    touching: wp.array2d(dtype=wp.float64),
    share: wp.array3d(dtype=wp.float64),
):
    """Raise ``height`` (len(xs), len(ys), b) [mm] to that of the triangles above each sample.

    A second pass is given ``touching`` nodes (n, b), 0 to 1. It leaves ``height``. ``share`` is the sum of their hats.
    """
    face, state = wp.tid()
    if touching.shape[0] > 0:
        marked = wp.float64(0.0)
        for k in range(6):
            marked += touching[faces[face, k], state]
        if marked == wp.float64(0.0):
            return
    two, three, four, half = wp.float64(2.0), wp.float64(3.0), wp.float64(4.0), wp.float64(0.5)
    zero, one = wp.float64(0.0), wp.float64(1.0)
    p0 = _position(nodes, u, faces[face, 0], state)
    p1 = _position(nodes, u, faces[face, 1], state)
    p2 = _position(nodes, u, faces[face, 2], state)
    p3 = _position(nodes, u, faces[face, 3], state)
    p4 = _position(nodes, u, faces[face, 4], state)
    p5 = _position(nodes, u, faces[face, 5], state)
    # The Bezier control points: the curved triangle is within their hull.
    q3, q4, q5 = two * p3 - half * (p0 + p1), two * p4 - half * (p1 + p2), two * p5 - half * (p2 + p0)
    low = wp.min(wp.min(wp.min(p0, p1), wp.min(p2, q3)), wp.min(q4, q5))
    high = wp.max(wp.max(wp.max(p0, p1), wp.max(p2, q3)), wp.max(q4, q5))
    # As wide as the tolerance of the search, so that a sample on an edge is not lost between two triangles.
    margin = wp.float64(1.0e-8)
    i0, i1 = _first_at_least(xs, low[0] - margin), _first_at_least(xs, high[0] + margin)
    j0, j1 = _first_at_least(ys, low[1] - margin), _first_at_least(ys, high[1] + margin)
    if i0 >= i1 or j0 >= j1:
        return
    b3, c3 = four * p3 - three * p0 - p1, four * p5 - three * p0 - p2
    d3, f3 = two * (p0 + p1) - four * p3, two * (p0 + p2) - four * p5
    e3 = four * (p0 - p3 + p4 - p5)
    a, b, c, d, e, f = _flat(p0), _flat(b3), _flat(c3), _flat(d3), _flat(e3), _flat(f3)
    # Bezier coefficients of the Jacobian determinant: all of one sign, and it has that sign everywhere.
    j00, j10, j01 = (
        _jacobian(b, c, d, e, f, zero, zero),
        _jacobian(b, c, d, e, f, one, zero),
        _jacobian(b, c, d, e, f, zero, one),
    )
    m0 = two * _jacobian(b, c, d, e, f, half, zero) - half * (j00 + j10)
    m1 = two * _jacobian(b, c, d, e, f, half, half) - half * (j10 + j01)
    m2 = two * _jacobian(b, c, d, e, f, zero, half) - half * (j00 + j01)
    least = wp.min(wp.min(wp.min(j00, j10), wp.min(j01, m0)), wp.min(m1, m2))
    most = wp.max(wp.max(wp.max(j00, j10), wp.max(j01, m0)), wp.max(m1, m2))
    # One sign and within a factor of two: the map is nearly affine, and one start of the search suffices.
    mild = least > half * most or most < half * least
    # The flat triangle of the corners: its inverse is where the search starts.
    s, t = _flat(p1) - a, _flat(p2) - a
    start = wp.matrix_from_rows(wp.vec2d(t[1], -t[0]), wp.vec2d(-s[1], s[0])) / _cross(s, t)
    for i in range(i0, i1):
        for j in range(j0, j1):
            at = _above(wp.vec2d(xs[i], ys[j]), p0, b3, c3, d3, e3, f3, start, mild)
            if at[2] > wp.float64(NOTHING / 2.0):
                if touching.shape[0] == 0:
                    wp.atomic_max(height, i, j, state, at[2])
                elif at[2] > height[i, j, state] - margin:
                    wp.atomic_max(share, i, j, state, _of_touching(touching, faces, face, state, at))


HIGHEST = {
    "cpu": wp.kernel(_highest, enable_backward=False, module="unique", module_options=ON_CPU),
    "cuda": wp.kernel(_highest, enable_backward=False, module="unique"),
}
"""The kernel for a kind of device: labels take their maps on the CPU, derivatives on the model's device."""
