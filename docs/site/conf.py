# Sphinx builds the site of the documents with this: script/docs.
import os
import re
from pathlib import Path

root = Path(os.environ["PENCILSCAN_ROOT"])
project = "pencilscan"
author = "The pencilscan authors"
version = release = re.search(r"project\(pencilscan VERSION (\S+)", (root / "CMakeLists.txt").read_text())[1]

extensions = ["myst_parser", "breathe", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "index"
source_suffix = {".md": "markdown"}
myst_heading_anchors = 4
highlight_language = "none"
html_theme = "sphinx_rtd_theme"
html_static_path = ["static"]
html_css_files = ["wide.css"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
html_title = f"pencilscan {version}"
autodoc_member_order = "bysource"
napoleon_use_ivar = True  # attributes once, where the class describes them
breathe_projects = {"pencilscan": os.environ["PENCILSCAN_DOXYGEN_XML"]}
breathe_default_project = "pencilscan"


def links_of_folders(app, name, source):
    """A site has no page of a folder or a source file: its name is enough there."""

    def plain(match):
        target = match[2].split("#")[0]
        if "://" in target or not target or match[0].startswith("!"):
            return match[0]
        here = Path(app.srcdir) / Path(name).parent
        return match[0] if (here / target).is_file() and target.endswith(".md") else match[1]

    source[0] = re.sub(r"!?\[([^][]*)\]\(([^() ]+)\)", plain, source[0])


def setup(app):
    app.connect("source-read", links_of_folders)
