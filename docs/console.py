"""Commands on a page are run when it is built, and what is shown is what they print.

    ```{console}
    :from: Systematic errors
    :rows: 20
    $ boresight inspect night.ast      # a remark
    ```

Shown are so many rows, from the first that begins with those words; without both, all. All commands
of a page run in one folder, see `examples`. What goes to standard error (progress, remarks) is not
shown. A command that fails stops the build. With `-D console_run=0` none is run.
"""

import tempfile
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import directives
from examples import commands, furnish, run, shown
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class Console(SphinxDirective):
    """Commands with what they print."""

    has_content = True
    option_spec = {"rows": directives.nonnegative_int, "from": directives.unchanged}  # noqa: RUF012 - docutils' own

    def run(self) -> list[nodes.Node]:
        """Run every line; the page's folder stays for its next block."""
        text = []
        for line in self.content:
            text.append(line)
            for command in commands(line) if self.config.console_run else ():
                printed = run(command, _folder(self.env.docname)).splitlines()
                begin, rows = self.options.get("from", ""), self.options.get("rows")
                text += [*shown(printed, begin, rows), ""]
        block = nodes.literal_block("\n".join(text).rstrip(), "\n".join(text).rstrip())
        block["language"] = "text"
        return [block]


_FOLDERS: dict[str, tempfile.TemporaryDirectory[str]] = {}


def _folder(page: str) -> Path:
    if page not in _FOLDERS:
        _FOLDERS[page] = tempfile.TemporaryDirectory(prefix="boresight-docs-")
        furnish(Path(_FOLDERS[page].name))
    return Path(_FOLDERS[page].name)


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx of the directive."""
    app.add_config_value("console_run", default=True, rebuild="env", types=(bool,))
    app.add_directive("console", Console)
    return {"parallel_read_safe": False}
