#!/usr/bin/python3
"""Takes the pictures of docs/panel.md: the screens of the page, on a phone and on a desktop, light and dark.

usage: test/panel/browser/pictures.py [FOLDER]

Needs an environment with stepdriver. FOLDER: docs/screens by default.
"""

import pathlib
import sys
import time

from machine import SOURCES, Machine, Page, browser, wait_until

HOUSE = SOURCES / "config/drawings/house.svg"
PHONE, DESKTOP = (360, 780), (1100, 860)


def machine_screen(page):
    page.click(page.axis("x", '[data-do="home"]'))
    page.wait_said("x is homed")  # otherwise this would replace the refusal below
    page.find(page.axis("y", ".goto input")).send_keys("999\n")
    page.wait_said("above the soft limit")


def drawing_screen(page):
    page.click("#tab-drawing")
    page.find("#svg").send_keys(str(HOUSE))
    wait_until(lambda: page.text("drawing-text").startswith("Ready"), "the drawing is ready")
    page.click("#draw")
    wait_until(lambda: page.text("drawing-text").startswith("Drawing:"), "the axes draw")
    time.sleep(6.0)


SHOTS = [
    ("panel_machine_phone", machine_screen, PHONE, False),
    ("panel_machine_desktop_dark", machine_screen, DESKTOP, True),
    ("panel_drawing_desktop", drawing_screen, DESKTOP, False),
]


def main(folder):
    machine = Machine()
    try:
        for name, show, size, dark in SHOTS:
            machine.calm()
            chrome = browser(*size, dark=dark, mobile=size == PHONE)
            try:
                page = Page(chrome).open_live(machine.link)
                page.machine = machine
                page.take_control()
                show(page)
                top = "document.getElementById('canvas').scrollIntoView({block: 'center'})"
                chrome.execute_script(top if show is drawing_screen and size == PHONE else "window.scrollTo(0, 0)")
                time.sleep(0.5)
                chrome.save_screenshot(str(folder / f"{name}.png"))
                print(folder / f"{name}.png", flush=True)
            finally:
                chrome.quit()
    finally:
        machine.end()


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else SOURCES / "docs/screens")
