"""Exported pages in headless Chromium, and their compiled code in it without pictures."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from typing import Any

import pytest

from hsdsl.export import files_of, source_of, write
from hsdsl.interface.model import Model

CHROMIUM = next(filter(None, map(which, ("chromium", "chromium-browser", "google-chrome"))), None)
DRIVER = which("chromedriver")
MISSING = [name for name, there in (("Chromium", CHROMIUM), ("chromedriver", DRIVER)) if not there]
MISSING += [f"the package {name}" for name in ("selenium", "ziglang") if find_spec(name) is None]


def needs_compiler(tests: Any) -> Any:
    """Mark tests that compile for the web; without a compiler they are skipped."""
    return pytest.mark.exports(pytest.mark.skipif(find_spec("ziglang") is None, reason="without ziglang")(tests))


def in_browser(tests: Any) -> Any:
    """Mark tests that need a browser; without one they are skipped."""
    skipped = pytest.mark.skipif(bool(MISSING), reason=f"without {', '.join(MISSING)}")
    return pytest.mark.exports(pytest.mark.tools(skipped(tests)))


def exported(model: Model, folder: Path, **arguments: Any) -> Path:
    """Export a model as a page, and return its path."""
    return write(files_of(source_of(model, arguments), "web"), folder, force=True)[0]


@contextmanager
def all_addresses() -> Iterator[None]:
    """Let what is started meanwhile have more addresses than tests may have: a browser takes far more than memory."""
    import resource

    ours, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (ours, most))


@contextmanager
def browser(width: int = 1280, height: int = 1000, dark: bool = False) -> Iterator[Any]:
    """A browser that reads no network."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", f"--window-size={width},{height}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    with all_addresses():
        driver = webdriver.Chrome(options=options, service=Service(DRIVER, log_output=os.devnull))
    driver.set_script_timeout(60)
    scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
    try:
        yield driver
    finally:
        driver.quit()


# ends when a run is back that is not one of those before
SETTLED = """
const [before, done] = arguments, at = () => Number(document.body.dataset.runs ?? 0);
const look = () => at() > before && !waiting ? done(at()) : setTimeout(look, 5);
look();
"""


def opened(driver: Any, path: Path, link: str = "") -> Any:
    """Open a page and wait for its first run."""
    driver.get("about:blank")
    driver.get(path.resolve().as_uri() + (f"#{link}" if link else ""))
    driver.execute_async_script(SETTLED, 0)
    return driver


def after(driver: Any, action: Any) -> None:
    """Do something that changes a setting, and wait for its run."""
    before = int(driver.execute_script("return document.body.dataset.runs"))
    action()
    driver.execute_async_script(SETTLED, before)


def typed(driver: Any, name: str, value: float) -> None:
    """Type a number into the box of a setting."""
    box = driver.find_element("css selector", f"input[name='{name}']")

    def action() -> None:
        driver.execute_script(
            "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'));", box, repr(value)
        )

    after(driver, action)


def numbers(driver: Any) -> dict[str, Any]:
    """The last run of a page, in the words of `hsdsl run --json`."""
    text = driver.execute_script("""
      const names = (mode, edge) =>
        edge === undefined ? model.modes[mode].states : model.modes[mode].edges[edge].states;
      const by = (mode, list, x) => Object.fromEntries(list.map((name, k) => [name, x[k]])
        .filter((_, k) => mode === undefined || hasState(mode, k)));
      const last = run.times.length - 1;
      return JSON.stringify({
        time: run.time, end: run.times[last], parameters: run.parameters,
        final: Object.fromEntries(model.columns.map((name, k) => [name, run.columns[k][last]])),
        transitions: run.transitions.map((made) => ({time: made.time, edge: edgeOf(made.mode, made.edge),
          resumed: made.resumed, before: by(made.mode, names(made.mode), made.before),
          after: Number.isNaN(made.resumed) ? null : by(made.target, names(made.mode, made.edge), made.after),
          alternatives: made.alternatives.map((k) => edgeOf(made.mode, k))})),
        modes: run.arcs.map((arc) => model.modes[arc.mode].name)});
    """)
    return json.loads(text)


def complaints(driver: Any) -> list[str]:
    """What the page has written to its console."""
    return [entry["message"] for entry in driver.get_log("browser")]


def parts(page: str) -> dict[str, str]:
    """The data elements of a page by their ids."""
    return dict(re.findall(r'<script type="[^"]+" id="(\w+)">(.*?)</script>', page, re.DOTALL))
