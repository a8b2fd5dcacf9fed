"""Configuration of the documentation: Sphinx, MyST, numpydoc, the pydata theme."""

from __future__ import annotations

import sys
from pathlib import Path

import frf_ipz

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_extensions"))

project = "frf_ipz"
author = "the frf_ipz authors"
copyright = "2026, the frf_ipz authors"
version = release = frf_ipz.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "generated_reference",
    "mathml",
]
exclude_patterns = ["_build", "_templates", "gallery/README.rst", "reference/generated"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
nitpicky = False

autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
intersphinx_mapping: dict[str, tuple[str, None]] = {}  # no page of others is fetched: the documentation builds offline

html_theme = "pydata_sphinx_theme"
html_math_renderer = "mathml"
html_title = f"frf_ipz {release}"
templates_path = ["_templates"]
html_static_path = ["_static"]
html_css_files = ["frf_ipz.css"]
html_show_sourcelink = False
html_theme_options = {
    "show_prev_next": True,
    "navigation_with_keys": False,
    "navbar_align": "left",
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}

sphinx_gallery_conf = {
    "examples_dirs": str(HERE / "gallery"),
    "gallery_dirs": "auto_gallery",
    "filename_pattern": r"/plot_",
    "download_all_examples": False,
    "show_signature": False,
    "remove_config_comments": True,
    "abort_on_example_error": True,
    "show_memory": False,
    "min_reported_time": 5,
}
