"""The elements that generators have, found on the images of a few vectors instead of on the matrices.

A generic vector has as many images under a finite group as the group has elements, so that the images stand for the
elements: a product costs a matrix times a vector.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_PROBES = 3  # vectors: one alone may by chance lie close to a mirror plane
SAME = 1e-7
"""Elements with entries of order one that differ by less are one. Those of a cyclic group of ten thousand elements
differ by 6e-4; round-off of as many products stays below 1e-11."""

_CELL = 8.0 * SAME


class Images:
    """Images of the probes, each with the number of its element."""

    def __init__(self, dimension: int) -> None:
        random = np.random.default_rng(0)
        self.probes: Array = random.uniform(-1.0, 1.0, (dimension, _PROBES))
        self._weights: Array = random.uniform(-1.0, 1.0, (dimension, _PROBES)) / dimension
        self.all: list[Array] = []
        self._cells: dict[int, list[int]] = {}

    def add(self, image: Array) -> None:
        """Give an image the next number."""
        self._cells.setdefault(self._cell(image), []).append(len(self.all))
        self.all.append(image)

    def number(self, image: Array) -> int | None:
        """Number of an image, shape (n, probes), None if it is not there."""
        cell = self._cell(image)
        for near in (cell, cell - 1, cell + 1):
            for number in self._cells.get(near, ()):
                if np.abs(self.all[number] - image).max() < SAME:
                    return number
        return None

    def _cell(self, image: Array) -> int:
        return math.floor(float(np.vdot(self._weights, image)) / _CELL)


def factors(generators: Array, largest: int) -> tuple[Indices, Indices] | None:
    """Every element as a generator times an earlier element; the first one is the identity.

    Parameters
    ----------
    generators
        Matrices with entries of order one, shape (generators, n, n).
    largest
        Order up to which elements are looked for.

    Returns
    -------
    generator, earlier
        Their numbers, shape (order,) both, without meaning for the identity; None if there are more than ``largest``
        elements.
    """
    images, by, of = Images(generators.shape[1]), [0], [0]
    images.add(images.probes)
    needed: list[int] = []
    for new, image in enumerate(generators @ images.probes):
        if images.number(image) is not None:
            continue
        needed.append(new)  # and the order at least doubles
        images, by, of = Images(generators.shape[1]), [0], [0]
        images.add(images.probes)
        done = 0
        while done < len(images.all):
            for number, product in zip(needed, generators[needed] @ images.all[done], strict=True):
                if images.number(product) is None:
                    if len(images.all) == largest:
                        return None
                    images.add(product)
                    by.append(number)
                    of.append(done)
            done += 1
    return np.array(by), np.array(of)
