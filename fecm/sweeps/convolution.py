"""Convolution of responses with forces that depend on the sums so far.

The sums are evaluated in blocks: a matrix product adds the contributions of earlier blocks, and
those of steps within the block are added one by one.
"""

from __future__ import annotations

import numpy as np
from numpy.fft import irfft, rfft
from numpy.typing import NDArray

from fecm._typing import Floats

# Steps of the blocks.  A force acts at once on the rest of the smallest block, which acts on the
# rest of the next larger one by a matrix product, and so on; complete largest blocks act on later
# ones by Fourier transforms.
NEAR = 8
BLOCK = 64
FAR = 256
TILE = 16  # cases of every matrix product, so that no case depends on the others


class Convolution:
    """Sums x_n = sum over m < n of r_(n-m) f_m of many cases, where f_n may depend on x_n.

    `responses` are r_1, r_2, ... of each sum and kind of case, (steps,) or (sums, steps, kinds);
    `kinds` (cases,), in ascending order, is the kind of each case.
    """

    def __init__(self, responses: Floats, kinds: NDArray[np.intp]) -> None:
        r = responses[None, :, None] if responses.ndim == 1 else responses
        sums, self._steps, count = r.shape
        cases = np.bincount(kinds, minlength=count)
        tiles = -(-cases // TILE)  # of each kind; the last is filled up
        last, blocks = np.cumsum(tiles), -(-self._steps // FAR)
        self._cuts = [slice(end - n, end) for n, end in zip(tiles, last, strict=True)]
        shifts = TILE * (last - tiles) - np.cumsum(cases) + cases
        self._place = np.arange(len(kinds)) + shifts[kinds]
        known = np.zeros((count, sums, FAR * (blocks + 1)))
        known[:, :, : self._steps] = r.transpose(2, 0, 1)
        self._near = np.repeat(known[:, :, :NEAR, None], tiles, axis=0)
        # Row t, column s: r_(t + size - s), the effect of a block of some size on later steps.
        windows = np.lib.stride_tricks.sliding_window_view
        self._tables = {
            size: windows(known[:, :, 1:], size, axis=2)[:, :, : end - size, ::-1].copy()
            for size, end in ((NEAR, BLOCK), (BLOCK, FAR))
        }
        parts = [known[:, :, FAR * n : FAR * (n + 2)] for n in range(blocks - 1)]
        self._filters = [rfft(np.roll(part, -FAR, axis=2))[..., None] for part in parts]
        self._spectra = np.empty((last[-1], len(parts), FAR + 1, TILE), dtype=complex)
        self._given = np.zeros((last[-1], FAR, TILE))  # of the last block
        self._block = np.zeros((last[-1], sums, FAR, TILE))
        self._values = np.zeros(last[-1] * TILE)
        self._step = 0

    def next(self) -> Floats:
        """Return x_n (sums, cases) of the next step n = 1, 2, ..."""
        rows = self._block[:, :, self._step % FAR].swapaxes(0, 1)
        found = rows.reshape(len(rows), -1)[:, self._place]
        self._step += 1
        if not self._step % NEAR and self._step < self._steps:
            for kind, tiles in enumerate(self._cuts):
                self._add_block(self._step, kind, tiles)
        return found

    def give(self, values: Floats) -> None:
        """Set f_n of the step last returned by :meth:`next`; f_0 before the first step."""
        self._values[self._place] = values
        given = self._values.reshape(-1, 1, 1, TILE)
        row, left = self._step % FAR, NEAR - self._step % NEAR
        self._given[:, row] = given[:, 0, 0]
        self._block[:, :, row : row + left] += self._near[:, :, :left] * given

    def _add_block(self, known: int, kind: int, tiles: slice) -> None:
        """Add the effect of a complete block, the last one, of forces on the later steps."""
        if known % FAR:
            size, end = (NEAR, BLOCK) if known % BLOCK else (BLOCK, FAR)
            row, rows = known % FAR, end - known % end
            factors = self._tables[size][kind, :, :rows]
            part = self._given[tiles, None, row - size : row]
            self._block[tiles, :, row : row + rows] += factors @ part
            return
        number = known // FAR
        for tile in range(tiles.start, tiles.stop):
            spectra = self._spectra[tile]
            spectra[number - 1] = rfft(self._given[tile], 2 * FAR, axis=0)
            total = self._filters[0][kind] * spectra[number - 1]
            for distance in range(1, number):
                total += self._filters[distance][kind] * spectra[number - 1 - distance]
            self._block[tile] = irfft(total, axis=1)[:, :FAR]
