"""What tests read of a report: its elements, its packed parts, its arrays."""

import base64
import re
import zlib
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

CHROMIUM = Path("/usr/bin/chromium")
VOID = {"meta", "link", "br", "hr", "img", "input", "path", "rect", "circle"}

needs_chromium = pytest.mark.skipif(
    not CHROMIUM.exists(), reason="there is no Chromium on this machine to draw the report"
)


class Page(HTMLParser):
    """Reads a page: its elements, and whether each that opens is closed in turn."""

    def __init__(self, text):
        super().__init__()
        self.open, self.faults, self.ids, self.links, self.text = [], [], [], [], []
        self.elements = []
        self.feed(text)
        self.faults += [f"never closed: {each}" for each in self.open]

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.elements.append((tag, found))
        self.ids += [found["id"]] if "id" in found else []
        self.links += [found["href"]] if "href" in found else []
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"{tag} closed at {self.getpos()}")

    def handle_data(self, data):
        if not {"script", "style"} & set(self.open):
            self.text.append(data)


def embedded(html, name):
    """The text of one script element."""
    return re.search(rf'<script type="[^"]+" id="{name}">(.*?)</script>', html, re.DOTALL)[1]


def inflated(html, name):
    """What one packed script element holds."""
    return zlib.decompress(base64.b64decode(embedded(html, name)))


def unpack(array):
    """The numbers of a packed array."""
    values = np.frombuffer(base64.b64decode(array["bdata"]), array["dtype"])
    shape = [int(each) for each in array.get("shape", str(len(values))).split(",")]
    return values.reshape(shape)


def running_browser():
    """Chromium, for a fixture to yield from; the test is skipped where its driver cannot start."""
    from playwright.sync_api import sync_playwright

    try:
        playwright = sync_playwright().start()
    except Exception as error:  # noqa: BLE001 - Playwright raises nothing more special
        pytest.skip(f"Playwright's driver does not start here (Debian: libatomic1): {error}")
    running = playwright.chromium.launch(
        executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"]
    )
    yield running
    running.close()
    playwright.stop()
