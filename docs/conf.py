"""The documentation site: ``make docs``.

The whole checkout is the source, so that a link between pages is the same in the site and where the files are read.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "docs"))

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
    "extension",
]
# A name of ours that leads nowhere is a mistake. What others define, and types, are words here.
nitpicky = True
nitpick_ignore_regex = [
    ("py:(attr|class|obj)", r"(?!chilopod\.).*"),
    ("py:.*", r"(matplotlib|mujoco|numpy|scipy|xarray)\..*"),
]

myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
smartquotes = False  # --set and "60 s" are typed as they are shown

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
html_js_files = ["site.js"]
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
    "image_scrapers": ("extension.scraped",),
    "thumbnail_size": (480, 360),
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": False,
    "min_reported_time": 3600,
    "write_computation_times": False,
    "show_memory": False,
    "show_signature": False,
    "download_all_examples": True,
    "remove_config_comments": True,
    "reset_modules": ("matplotlib",),
}
