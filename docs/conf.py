"""How the documentation is built: `make docs`, without a network, every warning an error."""

import atexit
import logging
import os
import shutil
import sys
import tempfile
from pathlib import Path

import boresight

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))

# Every notebook's kernel starts in a folder of its own with what the pages speak of in it.
IPYTHON = Path(tempfile.mkdtemp(prefix="boresight-docs-"))
atexit.register(shutil.rmtree, IPYTHON, ignore_errors=True)
PROFILE = IPYTHON / "profile_default"
(PROFILE / "startup").mkdir(parents=True)
(PROFILE / "startup" / "folder.py").write_text(
    f"""
def _enter():
    import os, pathlib, sys, tempfile
    sys.path.insert(0, {str(DOCS)!r})
    import examples
    os.chdir(examples.furnish(pathlib.Path(tempfile.mkdtemp(dir={str(IPYTHON)!r}))))
_enter()
""",
    encoding="utf-8",
)
# Jupyter warns of its own transport at every start; a page is not a server.
(PROFILE / "ipython_kernel_config.py").write_text(
    "c.IPKernelApp.log_level = 40\n", encoding="utf-8"
)
os.environ["IPYTHONDIR"] = str(IPYTHON)
logging.getLogger("traitlets").setLevel(logging.WARNING)

project, author = "boresight", "The boresight authors"
copyright = author  # noqa: A001 - Sphinx's name for it
version = release = boresight.__version__
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_design",
    "console",
    "mermaid",
]
exclude_patterns = ["_build"]

html_theme = "furo"
html_title = f"boresight {version}"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_show_sphinx = False
html_copy_source = False

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

default_role = "code"
napoleon_use_ivar = True
napoleon_use_rtype = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_class_signature = "mixed"
nitpicky = True
nitpick_ignore_regex = [
    ("py:class", r"[a-z]+[a-z_0-9]*"),  # several attributes that share a line, read as types
    ("py:class", r"(collections|boresight)\..*"),  # of signatures, not public by themselves
    ("py:exc", r"\w+Error"),  # all are in the tree of errors, few are public names
]
