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

_PROBES = 3
"""Vectors: one alone may by chance lie close to a mirror plane."""

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
        self._all: list[Array] = []
        self._cells: dict[int, list[int]] = {}

    def __len__(self) -> int:
        return len(self._all)

    def add(self, image: Array) -> None:
        """Give an image the next number."""
        self._cells.setdefault(self._cell(image), []).append(len(self._all))
        self._all.append(image)

    def number(self, image: Array) -> int | None:
        """Number of an image, shape (n, probes), None if it is not there."""
        cell = self._cell(image)
        for near in (cell, cell - 1, cell + 1):
            for number in self._cells.get(near, ()):
                if np.abs(self._all[number] - image).max() < SAME:
                    return number
        return None

    def __getitem__(self, number: int) -> Array:
        return self._all[number]

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
        while done < len(images):
            for number, product in zip(needed, generators[needed] @ images[done], strict=True):
                if images.number(product) is None:
                    if len(images) == largest:
                        return None
                    images.add(product)
                    by.append(number)
                    of.append(done)
            done += 1
    return np.array(by), np.array(of)


def generating(elements: Array, members: Indices) -> Indices | None:
    """A few of the members of a group that generate them all.

    Parameters
    ----------
    elements
        All elements, with entries of order one, shape (order, n, n).
    members
        Numbers of the members, shape (members,).

    Returns
    -------
    Numbers of elements; None if the members are not closed under products.
    """
    images = Images(elements.shape[1])
    for image in elements @ images.probes:
        images.add(image)
    identity = images.number(images.probes)
    if identity is None or identity not in members:
        return None
    chosen: list[int] = []
    translations: list[list[int | None]] = []
    reached = {identity}
    wanted = set(members.tolist())
    while reached != wanted:  # every new generator at least doubles what is reached
        new = min(wanted - reached, default=None)
        if new is None:
            return None
        chosen.append(new)
        translations.append(
            [images.number(elements[new] @ image) for image in map(images.__getitem__, range(len(images)))]
        )
        frontier = list(reached)
        while frontier:
            here = frontier.pop()
            for translation in translations:
                there = translation[here]
                if there is None:
                    return None
                if there not in reached:
                    reached.add(there)
                    frontier.append(there)
    return np.array(chosen or [identity])
