"""Kernels of `tacdata.skin.linear.constraint_rows`: constraints of batch members by the mortar rows that they join.

Also those of `cholesky.HalfRows`.

Indices: j a contact node, b a batch member, s a constraint of it. A constraint joins up to three neighbouring rows of
M with the components of its direction.
"""

from tacdata.warp_runtime import wp

SOFT = wp.constant(wp.float32(1.0e3))
"""Compliance of a slipping node, over the body's at the same node, up to which friction enters [1]: beyond, it is
nothing."""

PIVOT = wp.constant(128)
"""Rows of a block."""

STRIP = wp.constant(8)
"""Rows of the compliance a thread of `assemble` does, in one column."""

_LEAST = wp.constant(wp.float32(1.0e-30))


@wp.struct
class RowData:
    """`constraint_rows.ActiveRows`."""

    first: wp.array2d(dtype=wp.int32)
    direction: wp.array3d(dtype=wp.float32)
    give: wp.array3d(dtype=wp.float32)
    own: wp.array(dtype=wp.int32)


@wp.func
def loaded(table: wp.array2d(dtype=wp.float32), i: int, j: int, m: wp.vec3):
    """Displacements [mm/N] of three rows from i on, for a force along m at the rows from j on."""
    total = wp.vec3()
    for p in range(3):
        # A flat surface's constraint has one row, perhaps the last, and asks for no more.
        if i + p < table.shape[0]:
            for q in range(3):
                if m[q] != wp.float32(0.0):
                    total[p] = total[p] + m[q] * table[i + p, j + q]
    return total


@wp.func
def direction_of(rows: RowData, b: int, s: int):
    """Direction of a constraint."""
    return wp.vec3(rows.direction[b, s, 0], rows.direction[b, s, 1], rows.direction[b, s, 2])


@wp.func
def put_row(
    rows: RowData, b: int, s: int, first: int, direction: wp.vec3, compliance: wp.float32, coupling: wp.float32
):
    """Write a constraint: its rows, its direction, its compliance, and the coupling with the one before."""
    rows.first[b, s] = first
    for p in range(3):
        rows.direction[b, s, p] = direction[p]
    rows.give[b, s, 0] = compliance
    rows.give[b, s, 1] = coupling


@wp.kernel(enable_backward=False)
def describe(
    active: wp.array2d(dtype=wp.bool),
    slot: wp.array2d(dtype=wp.int64),
    normal: wp.array3d(dtype=wp.float64),
    friction: wp.array3d(dtype=wp.float64),
    flat: int,
    frictional: int,
    base: int,
    scale: wp.array(dtype=wp.float32),
    table: wp.array2d(dtype=wp.float32),
    rows: RowData,
):
    """Constraints of one contact's active nodes.

    1. The normal one gives way to nothing.
    2. Two tangents, the first from the axis least along the normal, so that their cross product is long.
    3. Friction's stiffness along these, D, with a floor; the constraints give way by D^-1.
    """
    j, b = wp.tid()
    if not active[j, b]:
        return
    s = wp.int32(slot[j, b])
    zero = wp.float32(0.0)
    # A flat surface has one mortar row a node, along z, and no friction directions.
    if flat == 1:
        put_row(rows, b, s, base + j, wp.vec3(wp.float32(normal[j, 2, b]), zero, zero), zero, zero)
        return
    first = base + 3 * j
    n = wp.vec3(wp.float32(normal[j, 0, b]), wp.float32(normal[j, 1, b]), wp.float32(normal[j, 2, b]))
    put_row(rows, b, s, first, n, zero, zero)
    if frictional == 0:
        return
    lowest = wp.int32(0)
    for i in range(1, 3):
        if wp.abs(n[i]) < wp.abs(n[lowest]):
            lowest = i
    axis = wp.vec3(zero, zero, zero)
    axis[lowest] = wp.float32(1.0)
    t = wp.normalize(wp.cross(n, axis))
    v = wp.cross(n, t)
    xx, yy, zz = wp.float32(friction[j, 0, b]), wp.float32(friction[j, 1, b]), wp.float32(friction[j, 2, b])
    xy, yz, xz = wp.float32(friction[j, 3, b]), wp.float32(friction[j, 4, b]), wp.float32(friction[j, 5, b])
    D = wp.mat33(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    # The stiffness along the slip is near 0 with the tangent, so D^-1 needs a bound.
    softness = SOFT * scale[b]
    along_t, along_v = loaded(table, first, first, t), loaded(table, first, first, v)
    tt = wp.dot(t, D * t) + wp.float32(1.0) / wp.max(softness * wp.dot(t, along_t), _LEAST)
    vv = wp.dot(v, D * v) + wp.float32(1.0) / wp.max(softness * wp.dot(v, along_v), _LEAST)
    tv = wp.dot(t, D * v)
    size = tt * vv - tv * tv
    put_row(rows, b, s + 1, first, t, vv / size, zero)
    put_row(rows, b, s + 2, first, v, tt / size, -tv / size)


@wp.kernel(enable_backward=False)
def assemble(
    member: wp.array(dtype=wp.int64),
    rows: RowData,
    scale: wp.array(dtype=wp.float32),
    table: wp.array2d(dtype=wp.float32),
    compliance: wp.array3d(dtype=wp.float32),
):
    """Compliance of the constraints of some members, its lower triangle, bordered by a unit matrix.

    The blocks on the diagonal, on which the inverse pivots, are written whole.
    """
    g, strip, j = wp.tid()
    first = strip * STRIP
    if j >= first + STRIP:
        return
    b = wp.int32(member[g])
    own, column, m = rows.own[b], rows.first[b, j], direction_of(rows, b, j)
    known, toward = wp.int32(-1), wp.vec3()
    for i in range(first, wp.min(first + STRIP, compliance.shape[1])):
        value = wp.float32(0.0)
        if j <= i and i < own:
            # The three constraints of a node join the same rows.
            if rows.first[b, i] != known:
                known = rows.first[b, i]
                toward = loaded(table, known, column, m)
            n = direction_of(rows, b, i)
            for p in range(3):
                if n[p] != wp.float32(0.0):
                    value += n[p] * toward[p]
            value = scale[b] * value
            if i == j:
                value += rows.give[b, i, 0]
            # Both tangents of a node are neighbours in this order; only they are coupled by D^-1.
            elif j == i - 1:
                value += rows.give[b, i, 1]
        # A unit matrix beyond the member's constraints keeps the padded matrix positive definite.
        elif i == j:
            value = wp.float32(1.0)
        if j <= i:
            compliance[g, i, j] = value
            if i / PIVOT == j / PIVOT:
                compliance[g, j, i] = value


@wp.kernel(enable_backward=False)
def along(
    change: wp.array2d(dtype=wp.float32),
    row_scale: wp.array(dtype=wp.float32),
    factor: wp.array(dtype=wp.float32),
    member: wp.array(dtype=wp.int32),
    rows: RowData,
    result: wp.array2d(dtype=wp.float32),
):
    """Displacements along the constraints, of those of all rows, scaled by row and member; shape (b, s)."""
    b, s = wp.tid()
    m = member[b]
    value = wp.float32(0.0)
    if s < rows.own[m]:
        first, n = rows.first[m, s], direction_of(rows, m, s)
        for p in range(3):
            if n[p] != wp.float32(0.0):
                value += n[p] * change[first + p, b] * row_scale[first + p]
    result[b, s] = value * factor[b]


@wp.kernel(enable_backward=False)
def answer(
    inverse: wp.array3d(dtype=wp.float32),
    v: wp.array2d(dtype=wp.float32),
    member: wp.array(dtype=wp.int32),
    going: wp.array(dtype=wp.int32),
    rows: RowData,
    y: wp.array2d(dtype=wp.float32),
    total: wp.array2d(dtype=wp.float32),
):
    """Let y = the inverse compliance times v, and add it to the total; symmetric, so neighbours read neighbours."""
    b, s = wp.tid()
    m = member[b]
    value = wp.float32(0.0)
    if s < rows.own[m] and going[b] == 1:
        for c in range(rows.own[m]):
            value += inverse[m, c, s] * v[b, c]
        total[b, s] = total[b, s] + value
    y[b, s] = value


@wp.kernel(enable_backward=False)
def onto_rows(
    y: wp.array2d(dtype=wp.float32),
    member: wp.array(dtype=wp.int32),
    rows: RowData,
    hard: wp.array2d(dtype=wp.float32),
    soft: wp.array2d(dtype=wp.float32),
):
    """Add forces of constraints to those on all rows: of such that give way to ``soft``, of others to ``hard``."""
    b, s = wp.tid()
    m = member[b]
    if s < rows.own[m]:
        first, n = rows.first[m, s], direction_of(rows, m, s)
        for p in range(3):
            if n[p] != wp.float32(0.0):
                if rows.give[m, s, 0] > wp.float32(0.0):
                    wp.atomic_add(soft, first + p, b, n[p] * y[b, s])
                else:
                    wp.atomic_add(hard, first + p, b, n[p] * y[b, s])


@wp.struct
class SparseRows:
    """Compressed rows, and the mortar row that each belongs to."""

    start: wp.array(dtype=wp.int32)
    column: wp.array(dtype=wp.int32)
    value: wp.array(dtype=wp.float32)
    row: wp.array(dtype=wp.int32)


@wp.kernel(enable_backward=False)
def along_rows(
    rows: SparseRows,
    used: wp.array2d(dtype=wp.bool),
    half: wp.array2d(dtype=wp.float32),
    result: wp.array2d(dtype=wp.float32),
):
    """Products of rows with the vectors of members, where these use them."""
    k, b = wp.tid()
    m = rows.row[k]
    if used[m, b]:
        total = wp.float32(0.0)
        for e in range(rows.start[k], rows.start[k + 1]):
            total += rows.value[e] * half[b, rows.column[e]]
        result[m, b] = total


@wp.kernel(enable_backward=False)
def less_rows(
    rows: SparseRows,
    used: wp.array2d(dtype=wp.bool),
    factor: wp.array2d(dtype=wp.float32),
    half: wp.array2d(dtype=wp.float32),
):
    """Take multiples of the rows that a member uses off its vector."""
    b = wp.tid()
    for k in range(rows.row.shape[0]):
        m = rows.row[k]
        if used[m, b]:
            for e in range(rows.start[k], rows.start[k + 1]):
                half[b, rows.column[e]] = half[b, rows.column[e]] - factor[m, b] * rows.value[e]
