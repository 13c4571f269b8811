#!/usr/bin/python3
"""Measures what the page costs: processor time of the panel, memory, and the time to its first paint.

usage: test/panel/browser/measure.py [--seconds N] [--minutes N]

Needs an environment with stepdriver. --seconds: of each measurement of the processor (30). --minutes: how long
a page is open while the axes move, after which nothing may have grown (1). Exit code 0: within the targets;
1: otherwise.
"""

import argparse
import os
import pathlib
import sys
import time

from machine import Machine, Page, browser

IDLE = 0.5  # [%] of a core, without a viewer
VIEWED = 5.0  # [%] with one
FIRST_PAINT = 1000.0  # [ms]
GROWTH = 4.0  # [MB]
LINGER = 3.0  # [s] after the last viewer, the panel unsubscribes
WARM = 20.0  # [s] until memory is judged


def processor_seconds(process):
    fields = pathlib.Path(f"/proc/{process}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory(process):
    """[MB]"""
    status = pathlib.Path(f"/proc/{process}/status").read_text(encoding="ascii")
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS")) / 1024.0


def share(process, seconds):
    """[%] of a core."""
    before, begin = processor_seconds(process), time.monotonic()
    time.sleep(seconds)
    return 100.0 * (processor_seconds(process) - before) / (time.monotonic() - begin)


def heap(chrome):
    """[MB] of the page's script, after a collection."""
    chrome.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
    metrics = chrome.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    return next(metric["value"] for metric in metrics if metric["name"] == "JSHeapUsedSize") / 1e6


def move_for(minutes, page, warm=WARM):
    """Both axes move all the time, in steps and by a refusal now and then, while the page is open. warm: [s] before
    the measurement. Returns the
    processor time of the panel [%], and how it and the page have grown [MB]."""
    from stepdriver.srv import MoveTo
    machine, process = page.machine, page.machine.panel_process()
    begun = time.monotonic()
    first, before = None, 0.0
    number = 0
    while time.monotonic() - begun < warm + 60.0 * minutes:
        number += 1
        for axis in ("x", "y"):
            machine.call(f"{axis}/move_to", MoveTo, position=0.02 + 0.1 * (number % 2), wait=False)
        if number % 10 == 0:
            page.click(page.axis("x", '[data-by="10"]'))
            page.find(page.axis("y", ".goto input")).send_keys("999\n")
        if number % 60 == 0:
            page.open_live(machine.link)
            page.take_control()
        time.sleep(1.0)
        if first is None and time.monotonic() - begun > warm:
            first, before = (memory(process), heap(page.driver)), processor_seconds(process)
    used = 100.0 * (processor_seconds(process) - before) / (time.monotonic() - begun - warm)
    return used, memory(process) - first[0], heap(page.driver) - first[1]


def main():
    command = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    command.add_argument("--seconds", type=float, default=30.0)
    command.add_argument("--minutes", type=float, default=1.0)
    options = command.parse_args()
    machine = Machine()
    failed = False

    def tell(what, value, unit, most):
        nonlocal failed
        failed = failed or value > most
        print(f"{what:42} {value:8.2f} {unit:4} target at most {most:g}", flush=True)
    try:
        process = machine.panel_process()
        time.sleep(LINGER)
        tell("processor without a viewer", share(process, options.seconds), "%", IDLE)
        chrome = browser()
        try:
            page = Page(chrome).open_live(machine.link)
            page.machine = machine
            paint = chrome.execute_script("return performance.getEntriesByName('first-contentful-paint')[0].startTime")
            tell("first paint", paint, "ms", FIRST_PAINT)
            machine.calm()
            tell("processor with one viewer, at rest", share(process, options.seconds), "%", VIEWED)
            chrome.execute_cdp_cmd("Performance.enable", {})
            used, panel, script = move_for(options.minutes, page)
            tell("processor with one viewer, in motion", used, "%", VIEWED)
            tell(f"growth of the panel in {options.minutes:g} min", panel, "MB", GROWTH)
            tell(f"growth of the page in {options.minutes:g} min", script, "MB", GROWTH)
        finally:
            chrome.quit()
    finally:
        machine.end()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
