"""The documentation site: `make docs` builds it from the pages in this folder, the examples and the docstrings."""

import sys
from importlib.metadata import version as installed
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))  # for `_reference`

project = "Outrider"
author = "The Outrider developers"
project_copyright = "The Outrider developers, Apache-2.0"
release = version = installed("outrider")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "_reference",
]
exclude_patterns = ["_build", "gallery/GALLERY_HEADER.rst"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
nitpicky = False  # docstrings are plain text: names in backquotes are no roles
default_role = "code"
suppress_warnings = ["config.cache", "ref.python"]  # types of one name in several packages

toc_object_entries = False  # thousands, copied into the sidebar of every page
autodoc_typehints = "none"  # `_reference` puts them into the signature as the source has them
maximum_signature_line_length = 100
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
add_module_names = False
python_use_unqualified_type_names = True

sphinx_gallery_conf = {
    "examples_dirs": ["../examples"],
    "gallery_dirs": ["gallery"],
    "plot_gallery": "False",  # `_reference` runs them as programs of their own, and adds what they print
    "ignore_pattern": r"__init__\.py",
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_signature": False,
    "show_memory": False,
    "write_computation_times": False,  # a page of its own, which loads scripts from elsewhere
    "min_reported_time": 1_000_000,
    "within_subsection_order": "FileNameSortKey",
    "matplotlib_animations": False,
}

html_theme = "furo"
html_title = f"Outrider {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navigation_with_keys": True,
    "light_css_variables": {"color-brand-primary": "#1a7fc4", "color-brand-content": "#1a6fae"},
    "dark_css_variables": {"color-brand-primary": "#4ba6e8", "color-brand-content": "#4ba6e8"},
}
