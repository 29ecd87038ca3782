"""Kernels of `tacdata.skin.linear.batched_inverse`, which keeps of symmetric matrices the lower triangle alone.

Blocks on the diagonal are inverted at once on a GPU, each by one block of threads.

A matrix stays in the registers of its block's 256 threads, eight rows by eight columns each. Every step of a sweep
(Goodnight, The American Statistician 33 (1979) 149) needs one row of it, which goes through shared memory. Libraries'
batched factorizations and triangular solves of this size take some fifty times as long.
"""

from functools import cache
from types import SimpleNamespace

import torch

from tacdata.skin.member.warp_arrays import REAL, argument
from tacdata.warp_runtime import wp

ROWS = 128
"""Size of the matrices."""

STRIP = wp.constant(8)
"""Rows of one column a thread of the other kernels does: of a mirror image they are eight neighbours in memory."""

_THREADS = 256

_SWEEPS = """
    __shared__ real line[2][128];
    const int tx = lane & 15, ty = lane >> 4;
    real* m = matrices.data + (size_t)matrix * 128 * 128;
    real r[8][8];
    #pragma unroll
    for (int a = 0; a < 8; ++a)
        #pragma unroll
        for (int b = 0; b < 8; ++b) r[a][b] = m[(ty + 16 * a) * 128 + tx + 16 * b];
    // Row 16 of + step: so its place in the registers is known to the compiler, which has to choose none.
    #pragma unroll
    for (int of = 0; of < 8; ++of)
        #pragma unroll 1
        for (int step = 0; step < 16; ++step) {
            real* row = line[step & 1];
            if (ty == step)
                #pragma unroll
                for (int b = 0; b < 8; ++b) row[tx + 16 * b] = r[of][b];
            // Two rows in turn: who writes the next has read all of the one before.
            __syncthreads();
            const real over = real(1) / row[16 * of + step];
            real along[8];
            #pragma unroll
            for (int b = 0; b < 8; ++b) along[b] = row[tx + 16 * b] * over;
            #pragma unroll
            for (int a = 0; a < 8; ++a) {
                const real down = row[ty + 16 * a];
                #pragma unroll
                for (int b = 0; b < 8; ++b) r[a][b] -= down * along[b];
                if (tx == step) r[a][of] = down * over;
            }
            if (ty == step) {
                #pragma unroll
                for (int b = 0; b < 8; ++b) r[of][b] = along[b];
                if (tx == step) r[of][of] = -over;
            }
        }
    #pragma unroll
    for (int a = 0; a < 8; ++a)
        #pragma unroll
        for (int b = 0; b < 8; ++b) m[(ty + 16 * a) * 128 + tx + 16 * b] = -r[a][b];
"""


@cache
def invert_kernel(real: type, name: str) -> wp.Kernel:
    """Compile the kernel of `invert_in_place` for numbers of a type, by Warp's and by C's name."""

    @wp.func_native(f"typedef {name} real;\n{_SWEEPS}")
    def sweep(matrices: wp.array(dtype=real), matrix: int, lane: int): ...

    @wp.kernel(module="unique", enable_backward=False, launch_bounds=(_THREADS, 1))
    def invert(matrices: wp.array(dtype=real)):
        matrix, lane = wp.tid()
        sweep(matrices, matrix, lane)

    return invert


def invert_in_place(matrices: torch.Tensor) -> None:
    """Invert symmetric positive definite matrices on a GPU, shape (b, 128, 128), contiguous."""
    kind = (wp.float64, "double") if matrices.dtype == torch.float64 else (wp.float32, "float")
    wp.launch(
        invert_kernel(*kind),
        dim=(len(matrices), _THREADS),
        inputs=[argument(matrices.view(-1))],
        device=str(matrices.device),
        block_dim=_THREADS,
    )


@cache
def sweep_kernels(dtype: torch.dtype) -> SimpleNamespace:
    """Compile the kernels for matrices of one precision."""
    real = REAL[dtype]

    @wp.kernel(module="unique", enable_backward=False)
    def take(
        a: wp.array3d(dtype=real), start: int, end: int, column: wp.array3d(dtype=real), pivot: wp.array3d(dtype=real)
    ):
        """Read the columns from ``start`` to ``end``, the block on the diagonal apart."""
        b, strip, c = wp.tid()
        for k in range(STRIP):
            i, value = strip * STRIP + k, real(0.0)
            # Only the lower triangle is up to date: entries above the pivot are read from their mirror images.
            if i < start:
                value = a[b, start + c, i]
            elif i < end:
                pivot[b, i - start, c] = a[b, i, start + c]
            else:
                value = a[b, i, start + c]
            column[b, i, c] = value

    @wp.kernel(module="unique", enable_backward=False)
    def put(
        swept: wp.array3d(dtype=real), pivot: wp.array3d(dtype=real), start: int, end: int, a: wp.array3d(dtype=real)
    ):
        """Write the block that `take` read, after its sweep."""
        b, strip, c = wp.tid()
        for k in range(STRIP):
            i = strip * STRIP + k
            if i < start:
                a[b, start + c, i] = swept[b, i, c]
            elif i < end:
                a[b, i, start + c] = -pivot[b, i - start, c]
            else:
                a[b, i, start + c] = swept[b, i, c]

    @wp.kernel(module="unique", enable_backward=False)
    def unfold(a: wp.array3d(dtype=real), row: wp.array(dtype=wp.int64), matrix: wp.array3d(dtype=real)):
        """Write the inverses, of which the negative lower triangle is known, as rows of ``whole``."""
        b, strip, j = wp.tid()
        m = wp.int32(row[b])
        for k in range(STRIP):
            i = strip * STRIP + k
            matrix[m, i, j] = -a[b, wp.max(i, j), wp.min(i, j)]

    return SimpleNamespace(take=take, put=put, unfold=unfold)
