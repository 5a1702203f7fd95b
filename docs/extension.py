"""What the site has beyond Sphinx: generated pages, names and types as in the source, formulas without a program."""

from __future__ import annotations

import enum
import inspect
import pickle
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import reference
from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from matplotlib.text import Text
from numpy.typing import ArrayLike
from pygments.lexer import Lexer
from pygments.lexers.shell import BashLexer, BashSessionLexer
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.domains.python import PyObject
from sphinx.environment import BuildEnvironment
from sphinx.util.typing import stringify_annotation
from sphinx.writers.html5 import HTML5Translator
from sphinx_gallery.scrapers import matplotlib_scraper

from chilopod.robot import load_robot
from chilopod.show.play import play

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
_PARAMETERS = re.compile(r"<dl>(\s*(?:<dd><em class=\"sig-param\">.*</dd>\s*)+)</dl>")
_LITERAL = re.compile(r"(``.*?``|`.*?`)")


class ShellLexer(Lexer):
    """Commands; behind a prompt, with what they print."""

    def get_tokens_unprocessed(self, text):  # type: ignore[no-untyped-def]
        """Tokens of one block."""
        inner = BashSessionLexer() if text.startswith("$ ") else BashLexer()
        return inner.get_tokens_unprocessed(text)


def docstring(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Keep ``|theta|`` and ``(x, *args)`` as they are written, both are markup elsewhere; and fields apart."""
    lines[:] = reference.apart("\n".join(lines) + "\n").splitlines()
    for index, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...")):
            parts = _LITERAL.split(line)
            parts[::2] = [re.sub(r"\||(?<=, )\*(?=\w)", r"\\\g<0>", part) for part in parts[::2]]
            lines[index] = "".join(parts)


def signature(app: Sphinx, what: str, name: str, obj: object, *told: object) -> tuple[str, None] | None:
    """Protocols and enumerations are called by nobody."""
    return ("", None) if isinstance(obj, enum.EnumType) or getattr(obj, "_is_protocol", False) else None


def without_modules(types: str) -> str:
    """Types without the modules that they stand in, but for one's own."""
    return re.sub(r"(?<![\w.])(?!chilopod\.)(?:\w+\.)+(?=\w)", "", types.replace("~", ""))


ARRAY_LIKE = without_modules(stringify_annotation(ArrayLike, "fully-qualified"))


def short_types(app: Sphinx, domain: str, objtype: str, content: nodes.Element) -> None:
    """Write types as in the source: ArrayLike, NDArray[float64], Path; one's own lead to where they are described."""
    for field in content.findall(nodes.field):
        kind, body = field[0].astext().partition(" ")[0], field[1]
        if kind in ("type", "vartype", "rtype"):
            text = without_modules(body.astext()).replace(ARRAY_LIKE, "ArrayLike")
            text = re.sub(r"ndarray\[tuple\[Any, \.\.\.\], dtype\[(\w+)\]\]", r"NDArray[\1]", text)
            text = re.sub(r"^Annotated\[(.*), (?:Flag|PlainValidator|Quantity)\(.*$", r"\1", text)
            body.children = [nodes.paragraph("", re.sub(r"\bchilopod\.[\w.]+", r"~\g<0>", text))]


def source_of(app: Sphinx, module: str, name: str) -> str | None:
    """Where the source of an entry stands; of a constant nowhere, not where its class is."""
    found = getattr(import_module(module), name, None)
    return None if found is None or isinstance(found, type) or inspect.isroutine(found) else module


def lead_to_gallery(app: Sphinx, page: nodes.document) -> None:
    """A link to the folder of examples leads to what the site makes of them."""
    folder = app.env.doc2path(app.env.docname).parent
    for node in page.findall(pending_xref):
        if node["reftype"] == "myst" and (folder / node["reftarget"]).resolve() == EXAMPLES:
            node.attributes.update(refdomain="doc", reftarget="docs/gallery/index", reftargetid=None)


def resolve(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement) -> nodes.Element | None:
    """Lead a name from within the packages to where it is exported; what is not exported is text, no mistake."""
    public = reference.public_name(node["reftarget"]) if node.get("refdomain") == "py" else None
    if public is None:
        return None
    python = env.get_domain("py")
    found = python.resolve_xref(env, node["refdoc"], app.builder, node["reftype"], public, node, content)
    return found or content


def visit_math(self: HTML5Translator, node: nodes.math | nodes.math_block) -> None:
    """Formulas as MathML, which browsers draw by themselves: others would load a program from outside."""
    self.body.append(tex2mathml(node.astext(), as_block=isinstance(node, nodes.math_block)))
    raise nodes.SkipNode


def scraped(block: tuple[Any, ...], block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Figures of a block of an example; the first panel of the first one, with large text, is the thumbnail."""
    if plt.get_fignums() and "thumbnail_path" not in block_vars["file_conf"]:
        figure = pickle.loads(pickle.dumps(plt.figure(plt.get_fignums()[0])))
        for text in figure.findobj(Text):
            text.set_fontsize(1.5 * text.get_fontsize())
        for other in figure.axes[1:]:
            other.set_visible(False)
        figure.canvas.draw()
        panel = figure.axes[0].get_tightbbox().padded(8.0).transformed(figure.dpi_scale_trans.inverted())
        path = Path(str(block_vars["image_path_iterator"].image_path.format(0)))
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, bbox_inches=panel, dpi=150)
        block_vars["file_conf"]["thumbnail_path"] = path
    return matplotlib_scraper(block, block_vars, gallery_conf)


def accessible(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: nodes.document | None) -> None:
    """Mend what screen readers stumble over: captions of contents, which Sphinx marks as headings, get the level that a
    heading needs; parameters on lines of their own are no list of descriptions, and a list within a list is an item."""
    for part in ("furo_navigation_tree", "body"):
        if part in context:
            context[part] = context[part].replace('role="heading">', 'role="heading" aria-level="2">')
    if "body" in context:
        body = _PARAMETERS.sub(r"<div>\1</div>", context["body"])
        body = re.sub(r'<dd>(<em class="sig-param">.*)</dd>', r'<div class="line">\1</div>', body)
        if page == "_modules/index":
            body = re.sub(r"</li>\s*<ul>", "<ul>", body)
            body = re.sub(r"</ul>(?=\s*(?:</ul>|<li>))", "</ul></li>", body)
        context["body"] = body


def play_page(app: Sphinx, failure: Exception | None) -> None:
    """Write the page in which the planar robot walks beside its description."""
    if failure is None and app.builder.format == "html":
        (Path(app.outdir) / "docs" / "play-page.html").write_text(play(load_robot("aoi2022-planar")), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Make all of it known to Sphinx."""
    app.add_object_type("robotkey", "robotkey", "pair: %s; robot file")
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math, None))  # type: ignore[arg-type]
    app.add_lexer("sh", ShellLexer)
    app.connect("builder-inited", lambda app: reference.write(Path(app.srcdir) / "docs" / "reference"))
    app.connect("autodoc-process-docstring", docstring, priority=400)  # before Napoleon
    app.connect("autodoc-process-signature", signature)
    app.connect("object-description-transform", short_types, priority=900)  # behind autodoc
    next(each for each in PyObject.doc_field_types if each.name == "variable").label = "Attributes"
    app.connect("viewcode-follow-imported", source_of)
    app.connect("doctree-read", lead_to_gallery)
    app.connect("missing-reference", resolve)
    app.connect("html-page-context", accessible, priority=900)  # behind the theme
    app.connect("build-finished", play_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
