"""Take the picture of a report: `python scripts/picture.py REPORT.html OUT.png [WIDTH [HEIGHT]]`.

Needs Playwright (extra `test`) and Chromium. Without HEIGHT the whole page is taken. The network
is off: what the picture shows, the file alone has drawn.
"""

import sys
from pathlib import Path

CHROMIUM = "/usr/bin/chromium"


def take(report: Path, out: Path, width: int = 1400, height: int | None = None) -> None:
    """Draw `report` in headless Chromium, `width` pixels wide, and write the picture to `out`."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_context(
            offline=True, viewport={"width": width, "height": height or 1000}
        ).new_page()
        page.on("pageerror", lambda error: print(f"page error: {error}", file=sys.stderr))
        page.goto(report.resolve().as_uri())
        page.wait_for_selector("html[data-drawn]", state="attached", timeout=60_000)
        page.screenshot(path=str(out), full_page=height is None)
        browser.close()


if __name__ == "__main__":
    source, picture, *size = sys.argv[1:]
    take(Path(source), Path(picture), *map(int, size))
