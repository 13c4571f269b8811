"""How the panel ends."""

import os
import pathlib
import signal
import unittest

from machine import Machine, Page, browser, wait_until


class TheEnd(unittest.TestCase):
    def test_is_soon_while_a_page_is_open_a_jog_lasts_and_a_call_waits(self):
        machine = Machine()
        self.addCleanup(machine.end)
        chrome = browser()
        self.addCleanup(chrome.quit)
        machine.calm()
        page = Page(chrome).open_live(machine.link)
        from stepdriver.srv import SpeedOverride
        machine.call("speed_override", SpeedOverride, factor=0.01)
        page.click(page.axis("x", '[data-do="home"]'))
        wait_until(lambda: machine.state("x")["moving"], "x is being homed, for long")
        page.hold(page.axis("y", '.jog[data-direction="1"]'))
        wait_until(lambda: machine.state("y")["moving"], "y jogs")
        process = machine.panel_process()
        os.kill(process, signal.SIGINT)
        wait_until(lambda: not machine.state("y")["moving"], "y rests")
        wait_until(lambda: not pathlib.Path(f"/proc/{process}").exists(), "the panel has ended")
        self.assertTrue(machine.state("x")["moving"], "the homing continues")
        wait_until(lambda: page.text("connection") == "not connected", "the page says so")
        page.release()
        self.assertNotIn("Traceback", machine.log.read_text(errors="replace"))
