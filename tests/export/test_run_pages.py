"""Pages of runs in a browser: zoom, values under the pointer, phase plots, and both colour schemes."""

from __future__ import annotations

import hand_made
import numpy as np
import pytest
from export.web_pages import browser, complaints, in_browser

from hsdsl.analysis.plot import plot

BALL = hand_made.bouncing_ball(bounces=4)
OTHER = hand_made.bouncing_ball(bounces=3, restitution="0.25")
PART = "return part()"


@in_browser
class TestPages:
    @pytest.fixture(scope="class")
    @classmethod
    def driver(cls):
        with browser() as started:
            yield started

    def opened(self, driver, path):
        driver.get(path.resolve().as_uri())
        assert complaints(driver) == []
        return driver

    @pytest.fixture(scope="class")
    @classmethod
    def page(cls, tmp_path_factory):
        path = tmp_path_factory.mktemp("pages") / "run.html"
        plot(BALL, path, units={"h": "m"})
        return path

    @pytest.fixture(scope="class")
    @classmethod
    def several(cls, tmp_path_factory):
        path = tmp_path_factory.mktemp("pages") / "runs.html"
        plot([BALL, OTHER], path, labels=["half", "quarter"], columns=["h"], phases=[("h", "v")])
        return path

    def pointed(self, driver, canvas, share, *events):
        """Point at a share of the width of a canvas' frame."""
        driver.execute_script(
            """
            const [canvas, share, events] = arguments, {box} = kept.get(canvas);
            const {left, top} = canvas.getBoundingClientRect(), clientY = top + (box.top + box.bottom) / 2;
            const where = {clientX: left + box.left + share * (box.right - box.left), clientY};
            canvas.setPointerCapture = () => {};
            for (const kind of events)
              canvas.dispatchEvent(new PointerEvent(kind, {...where, pointerType: "mouse", button: 0, bubbles: true}));
            """,
            canvas,
            share,
            list(events),
        )

    def values(self, driver):
        cells = driver.find_elements("css selector", "#values td[data-value]")
        return [float(cell.get_attribute("data-value")) for cell in cells]

    def test_the_pointer_shows_the_values_at_its_time(self, driver, page):
        self.opened(driver, page)
        canvas = driver.execute_script("return panels.get('h')")
        end = float(BALL.times[-1])
        for share in (0.1, 0.5, 0.9):
            self.pointed(driver, canvas, share, "pointermove")
            t, *found = self.values(driver)
            assert t == pytest.approx(share * end, abs=end / 500)
            point = BALL(t)
            assert found == pytest.approx([*point.state.values(), *point.outputs.values()], abs=1e-6)

    def test_a_drag_zooms_and_a_double_click_shows_the_whole_run(self, driver, page):
        self.opened(driver, page)
        canvas, end = driver.execute_script("return panels.get('v')"), float(BALL.times[-1])
        self.pointed(driver, canvas, 0.25, "pointerdown")
        self.pointed(driver, canvas, 0.5, "pointermove", "pointerup")
        assert driver.execute_script(PART) == pytest.approx([0.25 * end, 0.5 * end], rel=1e-6)
        low, high = driver.execute_script("return kept.get(panels.get('v')).up")
        inside = BALL.sample(np.linspace(0.25 * end, 0.5 * end, 200))["v"]
        assert low < inside.min() and high > inside.max() and high - low < 1.5 * (inside.max() - inside.min())
        driver.execute_script("arguments[0].dispatchEvent(new MouseEvent('dblclick'))", canvas)
        assert driver.execute_script(PART) == [0, end]

    def test_keys_zoom_and_move(self, driver, page):
        from selenium.webdriver.common.keys import Keys

        self.opened(driver, page)
        end = float(BALL.times[-1])
        for name, expected in (("closer", [0.25, 0.75]), ("later", [0.5, 1.0]), ("earlier", [0.25, 0.75])):
            driver.find_element("id", name).send_keys(Keys.ENTER)
            assert driver.execute_script(PART) == pytest.approx([share * end for share in expected])
        driver.find_element("id", "whole").send_keys(Keys.ENTER)
        assert driver.execute_script(PART) == [0, end]
        for name in ("farther", "whole", "earlier", "later"):
            assert not driver.find_element("id", name).is_enabled()
        for _ in range(80):  # it ends where numbers do
            driver.execute_script("$('closer').click()")
        start, behind = driver.execute_script(PART)
        assert 0 < behind - start < 1e-10 * end

    def test_no_other_panel_than_chosen_ones_and_a_value_for_each_run(self, driver, several):
        self.opened(driver, several)
        assert driver.execute_script("return shownPanels().map(([name]) => name)") == ["h"]
        canvas = driver.execute_script("return panels.get('h')")
        self.pointed(driver, canvas, 0.2, "pointermove")
        t, *found = self.values(driver)
        assert found == pytest.approx(
            [BALL(t).state["h"], OTHER(t).state["h"], BALL(t).state["v"], OTHER(t).state["v"]]
        )
        self.pointed(driver, canvas, 0.99, "pointermove")
        cells = [cell.text for cell in driver.find_elements("css selector", "#values tr:nth-child(2) td")]
        assert cells[1] == "ended"
        assert [item.text for item in driver.find_elements("css selector", "#legend li")][:2] == ["half", "quarter"]

    def test_curves_are_where_the_run_is(self, driver, page):
        """A pixel of the curve's colour is on the canvas at every sampled point, and a transition breaks the curve."""
        self.opened(driver, page)
        times = np.linspace(0.05, 0.95, 40) * float(BALL.times[-1])
        seen = driver.execute_script(
            """
            const [times, values] = arguments, canvas = panels.get("h"), {x, y} = kept.get(canvas);
            const ratio = window.devicePixelRatio || 1, context = canvas.getContext("2d"), [r, g, b] = [11, 83, 148];
            return times.map((t, i) => {
              const {data} = context.getImageData(ratio * x(t) - 2, ratio * y(values[i]) - 2, 5, 5);
              let best = 1e9;
              for (let k = 0; k < data.length; k += 4)
                best = Math.min(best, Math.abs(data[k] - r) + Math.abs(data[k + 1] - g) + Math.abs(data[k + 2] - b));
              return best;
            });
            """,
            times.tolist(),
            BALL.sample(times)["h"].tolist(),
        )
        assert max(seen) < 60

    @pytest.mark.parametrize(("width", "dark"), [(360, True), (1400, False)])
    def test_it_fits_the_screen_and_follows_the_colour_scheme(self, width, dark, several):
        with browser(dark=dark) as started:
            metrics = {"width": width, "height": 800, "deviceScaleFactor": 2, "mobile": width < 500}
            started.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
            self.opened(started, several)
            assert started.execute_script("return document.documentElement.scrollWidth") <= width
            ground = started.execute_script("return getComputedStyle(document.body).backgroundColor")
            assert ground == ("rgb(20, 24, 29)" if dark else "rgb(255, 255, 255)")
