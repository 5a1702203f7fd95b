"""Lines of the table paper | computed."""

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


def agrees(answer: Answer) -> str:
    """The verdict on something the paper prints."""
    return {True: "agrees", False: "differs", None: "undecided"}[answer]
