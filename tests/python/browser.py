# SPDX-License-Identifier: BSD-2-Clause
"""A real browser without a network, for the tests of pages."""

import io
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from playwright.sync_api import Frame, Page, sync_playwright

# Graphics in software: there is no other on machines that test.
OPTIONS = (
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-dev-shm-usage",  # of which containers have little
)
# Seconds. The scene is drawn slowly, and more so where other work goes on.
PATIENCE = 120.0


@contextmanager
def open_page(place: Path | str, width: int = 1280, height: int = 860) -> Iterator[Page]:
    """Opens a file with the network off, or an address of this machine.

    Fails if the page asks for anything else, or reports an error.
    """
    address = place.as_uri() if isinstance(place, Path) else place
    executable = shutil.which("chromium")
    # Which a snap is not free to read.
    if executable is None or executable.startswith("/snap/"):
        pytest.skip("there is no chromium, or none that may read temporary files")
    complaints: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=OPTIONS)
        context = browser.new_context(viewport={"width": width, "height": height})
        context.set_offline(isinstance(place, Path))
        page = context.new_page()
        page.set_default_timeout(1000 * PATIENCE)
        page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
        page.on("dialog", lambda dialog: complaints.append(f"dialog: {dialog.message}"))

        def read(message) -> None:
            if message.type in ("error", "assert"):
                complaints.append(f"console: {message.text}")

        def ask(route) -> None:
            asked = route.request.url
            if asked == address or (isinstance(place, str) and asked.startswith(address)):
                route.continue_()
            else:
                complaints.append(f"request: {asked}")
                route.abort()

        page.on("console", read)
        page.route("**/*", ask)
        # Not idle, which it never is.
        page.goto(address, wait_until="commit")
        yield page
        browser.close()
    assert complaints == []


def wait_for(condition: Callable[[], object], what: str) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"waited in vain for {what}"
        time.sleep(0.1)


def open_scene(page: Page) -> Frame:
    """The 3D scene of a report's page, when it is there, without what it says of slow graphics."""
    frame = page.locator("#scene").element_handle().content_frame()
    frame.locator("input.mantine-NumberInput-input").wait_for(state="attached")
    notice = frame.locator(".mantine-Notification-root", has_text="Software WebGL")
    notice.locator("button").click()
    notice.wait_for(state="detached")
    return frame


def picture(page: Page, selector: str) -> np.ndarray:
    """What one sees of an element: (height, width, 3) in [0, 1]."""
    png = page.locator(selector).screenshot(timeout=1000 * PATIENCE)
    return matplotlib.image.imread(io.BytesIO(png))[:, :, :3]


def settled_picture(page: Page, selector: str) -> np.ndarray:
    """The same, when it has stopped to change."""
    seen = [picture(page, selector)]

    def same() -> bool:
        time.sleep(0.5)
        seen.append(picture(page, selector))
        return difference(seen[-2], seen[-1]) == 0.0

    wait_for(same, f"{selector} to stop moving")
    return seen[-1]


def difference(first: np.ndarray, second: np.ndarray) -> float:
    """The share of the pixels that differ visibly."""
    return float(np.mean(np.abs(first - second).max(axis=2) > 0.05))
