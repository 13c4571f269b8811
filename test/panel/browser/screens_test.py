"""The drawing, the plots and the recordings; phones, dark mode, keyboards and screen readers."""

import http.server
import pathlib
import tempfile
import threading
import unittest

import measure
from machine import Machine, Page, browser, wait_until
from selenium.webdriver.common.keys import Keys

HOUSE = pathlib.Path(__file__).resolve().parents[3] / "config/drawings/house.svg"
PHONE = (360, 740)
LEAST_CONTRAST = 4.5  # WCAG 2, level AA
FIRST_PAINT = 1000.0  # [ms]

# The contrast of each text that is shown against the colour behind it: the ones that are too low.
CONTRASTS = """
function channels(text) { return text.match(/[\\d.]+/g).map(Number); }
function luminance([r, g, b]) {
  const linear = [r, g, b].map((c) => c / 255).map((c) => c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
}
function behind(element) {
  for (let one = element; one; one = one.parentElement) {
    const colour = channels(getComputedStyle(one).backgroundColor);
    if (colour.length === 3 || colour[3] > 0) return colour;
  }
  return [255, 255, 255];
}
const low = [];
for (const element of document.querySelectorAll("body *")) {
  const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
  if (!own || !element.checkVisibility() || element.disabled) continue;
  const [one, other] = [luminance(channels(getComputedStyle(element).color)), luminance(behind(element))];
  const contrast = (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);
  if (contrast < arguments[0]) low.push(`${element.tagName} "${element.textContent.trim()}": ${contrast.toFixed(2)}`);
}
return low;
"""
# The controls that have no name for a screen reader.
NAMELESS = """
return [...document.querySelectorAll("button, input, canvas, meter, [role=tabpanel]")].filter((one) =>
  !(one.getAttribute("aria-label") || one.getAttribute("aria-labelledby") || one.textContent.trim() ||
    (one.labels && one.labels.length && one.labels[0].textContent.trim()))).map((one) => one.outerHTML);
"""


def setUpModule():
    global machine
    machine = Machine()
    unittest.addModuleCleanup(machine.end)


class Screens(unittest.TestCase):
    def open(self, size=(1000, 900), dark=False):
        chrome = browser(*size, dark=dark, mobile=size[0] < 500)
        self.addCleanup(chrome.quit)
        page = Page(chrome).open_live(machine.link)
        page.take_control()
        return page

    def test_fit_on_a_phone_and_the_stop_is_always_in_reach(self):
        for dark in (False, True):
            page = self.open(PHONE, dark)
            for tab in ("machine", "drawing", "plots"):
                page.click(f"#tab-{tab}")
                width = page.driver.execute_script("return document.documentElement.scrollWidth")
                self.assertLessEqual(width, PHONE[0], tab)
                for scroll in ("0", "document.body.scrollHeight"):
                    hit = page.driver.execute_script(f"""
                        window.scrollTo(0, {scroll});
                        const box = document.getElementById("stop").getBoundingClientRect();
                        return document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2).closest("button").id;
                        """)
                    self.assertEqual(hit, "stop", tab)
                self.assertEqual(page.driver.execute_script(CONTRASTS, LEAST_CONTRAST), [], f"{tab}, dark: {dark}")
            colour = page.driver.execute_script("return getComputedStyle(document.body).backgroundColor")
            self.assertEqual(colour == "rgb(20, 22, 26)", dark, colour)

    def test_have_names_for_screen_readers_and_news_are_told(self):
        page = self.open()
        self.assertEqual(page.driver.execute_script(NAMELESS), [])
        for selector, role in (("#faults", "alert"), ("#said", "status"), ("#connection", "status")):
            self.assertEqual(page.find(selector).get_attribute("role"), role)

    def test_are_reached_by_the_keyboard(self):
        page = self.open()
        page.driver.execute_script("document.getElementById('tab-machine').focus()")
        page.keys(Keys.ARROW_RIGHT)
        self.assertTrue(page.find("#drawing").is_displayed())
        self.assertFalse(page.find("#machine").is_displayed())
        page.keys(Keys.ARROW_LEFT)
        reached = set()
        for _ in range(80):
            page.keys(Keys.TAB)
            reached.add(page.driver.execute_script(
                "const e = document.activeElement; return e.id || e.dataset.do || e.dataset.by || e.dataset.direction || e.type"))
        for wanted in ("stop", "emergency", "enable-all", "home-all", "override", "home", "10", "-1", "number"):
            self.assertIn(wanted, reached)

    def test_are_painted_soon(self):
        page = self.open()
        [paint] = page.driver.execute_script(
            "return performance.getEntriesByName('first-contentful-paint').map((entry) => entry.startTime)")
        print(f"first paint after {paint:.0f} ms; at most {FIRST_PAINT:.0f} on an idle computer")
        self.assertLess(paint, 20 * FIRST_PAINT)


class OnOnePage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.chrome = browser()
        cls.addClassCleanup(cls.chrome.quit)
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.chrome.execute_cdp_cmd("Browser.setDownloadBehavior", {
            "behavior": "allow", "downloadPath": folder.name})

    def setUp(self):
        machine.calm()
        self.page = Page(self.chrome).open_live(machine.link)
        self.page.take_control()


class Drawings(OnOnePage):
    def setUp(self):
        super().setUp()
        self.page.click("#tab-drawing")

    def set(self, field, value):
        self.page.find(f"#{field}").clear()
        self.page.find(f"#{field}").send_keys(value)

    def choose(self, text):
        """An SVG file, which the page reads at once."""
        file = self.folder / "chosen.svg"
        file.write_text(text, encoding="utf-8")
        # The drawing before is ready too.
        self.page.driver.execute_script(
            "document.getElementById('svg').value = ''; document.getElementById('drawing-text').textContent = ''")
        self.page.find("#svg").send_keys(str(file))

    def wait_text(self, words):
        wait_until(lambda: words in self.page.text("drawing-text"),
                   lambda: f"the page says {words!r}; it says {self.page.text('drawing-text')!r}")

    def painted(self, name):
        """How many points of the canvas have a colour."""
        return self.page.driver.execute_script("""
            const canvas = document.getElementById("canvas");
            const hex = getComputedStyle(document.documentElement).getPropertyValue("--" + arguments[0]).trim();
            const wanted = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
            const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
            let count = 0;
            for (let i = 0; i < data.length; i += 4)
              if (data[i + 3] > 128 && wanted.every((value, c) => Math.abs(data[i + c] - value) < 24)) count += 1;
            return count;""", name)

    def test_is_shown_with_its_facts_and_then_drawn(self):
        pulses = machine.pulses("x") + machine.pulses("y")
        self.choose(HOUSE.read_text(encoding="utf-8"))
        self.wait_text("Ready")
        facts = self.page.text("drawing-facts")
        for words in ("size", "mm drawn", "between strokes", "rounded by up to 0.05 mm"):
            self.assertIn(words, facts)
        self.assertRegex(facts, r"time\s+[0-9]")
        wait_until(lambda: self.painted("line") > 100, "the lines are painted")
        self.assertEqual(machine.pulses("x") + machine.pulses("y"), pulses, "nothing moves before Draw")
        self.assertEqual(self.painted("pen"), 0)
        self.page.click("#draw")
        self.wait_text("Drawing")
        wait_until(lambda: self.painted("pen") > 50, "the way of the axes grows")
        self.wait_text("Drawn")
        self.assertGreater(machine.pulses("x"), pulses)
        self.assertFalse(any(machine.state(axis)["moving"] for axis in "xy"))

    def test_is_stopped(self):
        self.set("speed", "5")
        self.choose(HOUSE.read_text(encoding="utf-8"))
        self.wait_text("Ready")
        self.page.click("#draw")
        wait_until(lambda: machine.state("x")["moving"], "the axes draw")
        self.page.keys(Keys.ESCAPE)
        self.wait_text("It ended before its end")
        self.assertFalse(machine.state("x")["moving"])

    def test_shows_what_will_be_refused(self):
        self.set("scale", "100")
        self.set("corner-x", "0")
        self.set("corner-y", "0")
        self.choose('<svg xmlns="http://www.w3.org/2000/svg" width="20" height="20"><path d="M1 1L19 19" stroke="#000"/></svg>')
        self.wait_text("(0, 1800) mm is above the soft limit of y, 150 mm")
        self.assertFalse(self.page.find("#draw").is_enabled())
        wait_until(lambda: self.painted("line") > 10, "it is shown nevertheless")

    def test_a_change_after_the_preview_needs_another_preview(self):
        self.choose(HOUSE.read_text(encoding="utf-8"))
        self.wait_text("Ready")
        self.set("speed", "20")
        self.assertFalse(self.page.find("#draw").is_enabled())
        self.page.click("#preview")
        wait_until(lambda: self.page.find("#draw").is_enabled(), "it can be drawn again")

    def test_malicious_files_run_nothing_and_fetch_nothing(self):
        asked = []

        class Site(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                asked.append(self.path)
                self.send_response(404)
                self.end_headers()

            def log_message(self, *_):
                pass
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Site)
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        site = f"http://127.0.0.1:{server.server_port}"
        secret = self.folder / "secret.svg"
        secret.write_text('<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><path d="M1 1L8 8" stroke="#000"/></svg>')
        line = '<path d="M10 10L90 90" stroke="#000"/>'
        svg = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" width="100" height="100"'
        attacks = {
            "script": f'<svg {svg} onload="fetch(\'{site}/onload\')"><script>window.hacked = 1; fetch("{site}/script")</script>{line}</svg>',
            "image": f'<svg {svg}>{line}<image href="{site}/image.png" width="9" height="9"/></svg>',
            "use": f'<svg {svg}>{line}<use href="{site}/use.svg#a"/></svg>',
            "use of a file": f'<svg {svg}>{line}<use href="file://{secret}#a"/></svg>',
            "style": f'<svg {svg}><style>@import url("{site}/style.css"); path {{ fill: url("{site}/fill.svg#a") }}</style>{line}</svg>',
            "style sheet": f'<?xml-stylesheet href="{site}/sheet.css" type="text/css"?><svg {svg}>{line}</svg>',
            "entity": f'<!DOCTYPE svg [<!ENTITY e SYSTEM "file:///etc/passwd">]><svg {svg}>{line}<text>&e;</text></svg>',
            "external type": f'<!DOCTYPE svg SYSTEM "{site}/svg.dtd"><svg {svg}>{line}</svg>',
            "include": f'<svg {svg} xmlns:xi="http://www.w3.org/2001/XInclude"><xi:include href="{site}/include"/>{line}</svg>',
            "foreign object": f'<svg {svg}><foreignObject><iframe xmlns="http://www.w3.org/1999/xhtml" src="{site}/frame"/></foreignObject>{line}</svg>',
            "laughs": '<!DOCTYPE svg [<!ENTITY a "aaaaaaaaaa">' + "".join(
                f'<!ENTITY {new} "{f"&{old};" * 10}">' for old, new in zip("abcdefghi", "bcdefghij")) +
                f']><svg {svg}><text>&j;</text>{line}</svg>',
            "not SVG": "<html><script>window.hacked = 1</script></html>",
            "name": f'<svg {svg}><title>&lt;img src=x onerror="window.hacked=1"&gt;</title>{line}</svg>',
        }
        for name, text in attacks.items():
            with self.subTest(name):
                self.choose(text)
                wait_until(lambda: self.page.text("drawing-text").startswith(("Ready", "Refused")), f"{name} is judged")
        self.assertEqual(asked, [])
        self.assertFalse(self.page.driver.execute_script("return 'hacked' in window"))
        self.assertTrue(self.page.is_live())

    def test_a_file_that_is_too_large_is_refused(self):
        self.choose('<svg xmlns="http://www.w3.org/2000/svg"><!--' + "x" * (5 << 20) + "--></svg>")
        self.wait_text("at most 4194304 are allowed")


class Growth(OnOnePage):
    def test_neither_the_page_nor_the_panel_grows(self):
        self.page.machine = machine
        self.chrome.execute_cdp_cmd("Performance.enable", {})
        used, panel, script = measure.move_for(0.2, self.page, 8.0)
        print(f"{used:.1f} % of a core; the panel grew by {panel:.1f} MB, the page by {script:.1f} MB")
        self.assertLess(panel, measure.GROWTH)
        self.assertLess(script, measure.GROWTH)


class Plots(OnOnePage):
    def setUp(self):
        super().setUp()
        self.page.click("#tab-plots")

    def test_show_the_last_minute(self):
        from stepdriver.srv import MoveTo
        machine.call("x/move_to", MoveTo, position=0.03, wait=True)
        machine.call("x/move_to", MoveTo, position=0.05, wait=True)
        first = "#curves .card:first-child"
        wait_until(lambda: "now 50.00" in self.page.find(f"{first} p").text, "the plot shows the position")
        self.assertEqual(len(self.page.driver.find_elements("css selector", "#curves canvas")), 5)
        label = self.page.find(f"{first} canvas").get_attribute("aria-label")
        self.assertIn("x: position: now 50.00", label)

    def test_recordings_are_written_listed_and_saved(self):
        self.page.click("#dump")
        wait_until(lambda: ".txt" in self.page.text("recordings"), "the recording is listed")
        self.page.click("#recordings li:first-child button")
        saved = wait_until(lambda: [file for file in self.folder.glob("stepdriver_*") if file.suffix in (".txt", ".vcd")],
                           "the file is saved")[0]
        there = machine.folder / "recordings" / saved.name
        wait_until(lambda: saved.read_bytes() == there.read_bytes(), "it is the same file")
