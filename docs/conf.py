"""The documentation site: ``make docs``.

The whole checkout is the source, so that a link between pages is the same in the site and where the files are read.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from numpy.typing import ArrayLike
from pygments.lexer import Lexer
from pygments.lexers.shell import BashLexer, BashSessionLexer
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.domains.python import PyObject
from sphinx.environment import BuildEnvironment
from sphinx.util.typing import stringify_annotation
from sphinx.writers.html5 import HTML5Translator

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "docs"))

import reference  # noqa: E402

import chilopod  # noqa: E402

project = "chilopod"
version = release = chilopod.__version__
root_doc = "docs/index"
include_patterns = ["docs/**", "CHANGELOG.md", "CONTRIBUTING.md", "benchmarks/README.md"]
exclude_patterns = [
    ".*",
    "build",
    "dist",
    "src",
    "tests",
    "torture",
    "examples",
    "docs/templates",
    "docs/gallery/*.ipynb",
]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_gallery.gen_gallery",
]
nitpicky = True
nitpick_ignore_regex = [("py:.*", r"(?!chilopod).*")]

myst_heading_anchors = 4

# Types stand in annotations; Napoleon, which comes with Sphinx, joins them to what the docstrings say.
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
autosummary_generate = False
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
default_role = "py:obj"
add_module_names = False
toc_object_entries_show_parents = "hide"
maximum_signature_line_length = 88
python_display_short_literal_types = True

html_theme = "furo"
html_math_renderer = "mathml"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["disk.js"]
html_logo = html_favicon = "static/logo.svg"
html_title = "chilopod"
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = html_show_copyright = False
templates_path = ["templates"]
html_additional_pages = {"index": "redirect.html"}

sphinx_gallery_conf = {
    "examples_dirs": str(ROOT / "examples"),
    "gallery_dirs": str(ROOT / "docs" / "gallery"),
    "filename_pattern": r"/\d\d_",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": False,
    "min_reported_time": 3600,
    "write_computation_times": False,
    "show_memory": False,
    "show_signature": False,
    "download_all_examples": True,
    "remove_config_comments": True,
    "reset_modules": ("matplotlib",),
    "junit": "../gallery.xml",
}


_LITERAL = re.compile(r"(``.*?``|`.*?`)")


class ShellLexer(Lexer):
    """Commands; behind a prompt, with what they print."""

    def get_tokens_unprocessed(self, text):  # type: ignore[no-untyped-def]
        """Tokens of one block."""
        inner = BashSessionLexer() if text.startswith("$ ") else BashLexer()
        return inner.get_tokens_unprocessed(text)


def formulas(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Keep |theta| and (x, *args) of docstrings as they are written: both are markup elsewhere."""
    for index, line in enumerate(lines):
        parts = _LITERAL.split("" if line.lstrip().startswith((">>>", "...")) else line)
        parts[::2] = [re.sub(r"\||(?<=, )\*(?=\w)", r"\\\g<0>", part) for part in parts[::2]]
        lines[index] = "".join(parts) or line


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


def resolve(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement) -> nodes.Element | None:
    """Lead a name from within the packages to where it is exported; what is not exported is text, no mistake."""
    public = reference.public_name(node["reftarget"]) if node.get("refdomain") == "py" else None
    if public is None or public == node["reftarget"]:
        return content if public else None
    python = env.get_domain("py")
    return python.resolve_xref(env, node["refdoc"], app.builder, node["reftype"], public, node, content)


def visit_math(self: HTML5Translator, node: nodes.math | nodes.math_block) -> None:
    """Formulas as MathML, which browsers draw by themselves: others would load a program from outside."""
    self.body.append(tex2mathml(node.astext(), as_block=isinstance(node, nodes.math_block)))
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Write the pages that are generated before they are looked for."""
    app.add_object_type("robotkey", "robotkey", "pair: %s; robot file")
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math, None))  # type: ignore[arg-type]
    app.add_lexer("sh", ShellLexer)
    app.connect("builder-inited", lambda app: reference.write(Path(app.srcdir) / "docs" / "reference"))
    app.connect("autodoc-process-docstring", formulas, priority=400)  # before Napoleon
    app.connect("object-description-transform", short_types, priority=900)  # behind autodoc
    next(each for each in PyObject.doc_field_types if each.name == "variable").label = "Attributes"
    app.connect("missing-reference", resolve)
