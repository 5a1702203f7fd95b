"""Enumerations whose members have a label for tables and a sentence for readers."""

from __future__ import annotations

import enum


class Labelled(enum.Enum):
    """Base of enumerations whose members are given as a label and a sentence."""

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        self.sentence = sentence
