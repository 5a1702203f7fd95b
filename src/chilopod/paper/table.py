"""Lines of the two tables: paper | planar model, and robot | twin | planar model."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from chilopod.paper.scatter import Answer


@dataclass(frozen=True)
class Row:
    """A line of the table paper | computed.

    Attributes
    ----------
    quantity, paper, computed
        In words and numbers with units; ``paper`` says so where it prints none.
    where
        Of the paper.
    verdict
        "agrees", "differs", "undecided" if the scatter of trials leaves it open, or "not printed".
    remark
        Why it differs, if it does.
    """

    quantity: str
    paper: str
    computed: str
    where: str
    verdict: str
    remark: str = ""

    def as_json(self) -> dict[str, str]:
        """The row by column."""
        return asdict(self)


@dataclass(frozen=True)
class RobotRow:
    """A line of the table.

    Attributes
    ----------
    quantity
        What it is about.
    robot, twin, planar
        What the paper prints of its robot, what the twin does, and what the planar model does, empty where it was not
        asked; in words and numbers with units.
    kind
        "fitted" if the twin's constants were fitted to it, else "predicted"; "checked" for what is about the twin.
    verdict
        "within" or "outside" of what is asked of the twin, or "undecided" if the scatter of trials leaves that open.
    asked
        What counts as within.
    """

    quantity: str
    robot: str
    twin: str
    planar: str
    kind: str
    verdict: str
    asked: str

    def as_json(self) -> dict[str, str]:
        """The row by column."""
        return asdict(self)


def agrees(answer: Answer) -> str:
    """The verdict on something the paper prints."""
    return {True: "agrees", False: "differs", None: "undecided"}[answer]
