"""Whether all text of a figure is shown, and none is tiny."""

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from chilopod.report.kit import style


def painted(figure, monkeypatch) -> list[Text]:
    """The texts that are really painted: not those of hidden axes or of ticks outside the limits."""
    found = []
    draw = Text.draw
    with monkeypatch.context() as patch:
        patch.setattr(Text, "draw", lambda self, renderer: (found.append(self), draw(self, renderer)))
        FigureCanvasAgg(figure).draw()
    return [text for text in found if text.get_visible() and text.get_text().strip()]


def check(panel, narrow, monkeypatch) -> None:
    """Draw a panel and look at its texts."""
    with style.house_style():
        figure = panel.draw(narrow)
        for text in painted(figure, monkeypatch):
            box, extent = figure.bbox, text.get_window_extent()
            assert extent.x0 > -1 and extent.y0 > -1, (panel.name, text.get_text())  # noqa: PT018
            assert extent.x1 < box.x1 + 1 and extent.y1 < box.y1 + 1, (panel.name, text.get_text())  # noqa: PT018
            assert text.get_fontsize() >= style.SMALL, (panel.name, text.get_text())
