"""The documentation site: `make docs` builds it from the pages as they are in the repository.

The source folder is the repository itself, so that a link leads to the same page on the site as
on a code host, and nothing is written twice.
"""

from seecr import __version__

project = "seecr and crosscheck"
copyright = "the authors; Apache-2.0"
release = version = __version__

root_doc = "docs/index"
include_patterns = ["*.md", "docs/*.md", "models/README.md", "examples/*"]
exclude_patterns = [".venv*", "build", "dist", "docs/joss", "CODE_OF_CONDUCT.md", "SECURITY.md"]
extensions = ["myst_nb"]

smartquotes = False  # two hyphens begin an option
myst_heading_anchors = 4  # by the names that code hosts give them
nitpicky = True
# notebooks are kept without outputs and run here; one that fails stops the build
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True

html_theme = "furo"
html_title = f"seecr {version}"
html_static_path, html_css_files = ["static"], ["wide.css"]
html_extra_path = ["front"]  # index.html, which leads to docs/index.html
