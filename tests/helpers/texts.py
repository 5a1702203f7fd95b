"""Whether all text of figures is shown, and none is tiny: looked at while they are painted."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest
from matplotlib.text import Text

from chilopod.show import style


@dataclass
class Painted:
    """How many texts were painted, and those that are cut or tiny.

    Texts of hidden axes and of ticks outside the limits are not painted.
    """

    count: int = 0
    cut: list[str] = field(default_factory=list)
    tiny: list[str] = field(default_factory=list)

    def look_at(self, text: Text) -> None:
        if not (text.get_visible() and text.get_text().strip()):
            return
        self.count += 1
        box, extent = text.figure.bbox, text.get_window_extent()
        if extent.x0 < -1 or extent.y0 < -1 or extent.x1 > box.x1 + 1 or extent.y1 > box.y1 + 1:
            self.cut.append(text.get_text())
        if text.get_fontsize() < style.SMALL:
            self.tiny.append(text.get_text())


@contextmanager
def watched() -> Iterator[Painted]:
    """What is painted within it, in whatever thread."""
    painted, draw = Painted(), Text.draw

    def drawn(text: Text, renderer: object) -> None:
        draw(text, renderer)
        painted.look_at(text)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", drawn)
        yield painted
