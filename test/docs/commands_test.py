#!/usr/bin/env python3
"""Runs the commands of the project's pages, and checks their output.

usage: test/docs/commands_test.py [PAGE...]

Needs an environment with stepdriver. commands.yaml lists the commands of each page, in order, and their
expected results; command_table_test.py compares it with the pages. Each page has a ROS master, a folder
and a thread of its own. Exit code 0: all commands did what is expected; 1: otherwise.
"""

import concurrent.futures
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time

import rosgraph
import yaml

import pages

BOUND = 120  # [s] limit of each wait: long enough for a machine under load
TABLE = pages.ROOT / "test/docs/commands.yaml"


class Failed(Exception):
    pass


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def lives(group):
    """Whether any process of a group is running. The leader alone isn't enough: rosbag ends before its
    children, which write the bag."""
    for stat in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, pgrp = stat.read_text(encoding="utf-8").rpartition(")")[2].split()[:3]
        except OSError:
            continue  # it has just ended
        if int(pgrp) == group and state not in "ZX":
            return True
    return False


class Page:
    """The reader who follows a page, with terminals and a folder that has the files that it assumes."""

    def __init__(self, name, folder):
        self.name = name
        self.folder = folder
        self.started = []
        port = free_port()
        self.environment = dict(
            os.environ,
            ROS_MASTER_URI=f"http://127.0.0.1:{port}",
            ROS_HOME=str(folder / "ros"),
            MPLBACKEND="Agg",
            STEPDRIVER_SOURCES=str(pages.ROOT),
        )
        axis = (pages.ROOT / "config/a4988.yaml").read_text(encoding="utf-8")
        for file in ("my_axis.yaml", "my_axes.yaml"):
            (folder / file).write_text(axis + "\ngpio: {backend: simulated}\n", encoding="utf-8")

        self.parameters = rosgraph.Master("/pages", self.environment["ROS_MASTER_URI"])
        self.master = None
        self.port = port

    def begin(self):
        """Starts the master that all launches of this page share."""
        self.master = self.open(["rosmaster", "--core", "-p", str(self.port)], "master.log")
        deadline = time.monotonic() + BOUND
        while not self.parameters.is_online():
            if time.monotonic() > deadline:
                raise Failed("there is no master")
            time.sleep(0.1)

    def open(self, command, log):
        with (self.folder / log).open("w") as output:
            return subprocess.Popen(
                # The process ends with this program, however that ends.
                ["setpriv", "--pdeathsig", "TERM", *command],
                cwd=self.folder, env=self.environment, start_new_session=True,
                stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
            )

    def here(self, command):
        """The command with the page's paths replaced by those of this machine."""
        here = {
            "build/install": os.environ["CMAKE_PREFIX_PATH"].split(":")[0],
            "/path/to/": f"{self.folder}/",
            "/tmp/": f"{self.folder}/",
        }
        return ["bash", "-c", re.sub("|".join(here), lambda there: here[there[0]], command)]

    def run(self, entry, command):
        answer = subprocess.run(
            self.here(" && ".join([command] + entry.get("and", []))),
            cwd=self.folder, env=self.environment, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=BOUND,
        )
        ends = entry.get("ends", 0)
        if answer.returncode != ends:
            raise Failed(f"ended with {answer.returncode}, not {ends}:\n{answer.stdout}")
        for said in entry.get("says", []):
            if said not in answer.stdout:
                raise Failed(f"doesn't say \"{said}\":\n{answer.stdout}")

    def start(self, entry, command):
        if command.startswith("roslaunch ") and not entry.get("beside"):
            self.end()
            # A launch file clears parameters that were set before it, so a second launch file of the same
            # roslaunch sets the speed.
            speed = entry.get("speed", 1.0)
            (self.folder / "speed.launch").write_text(
                f'<launch><param name="/stepdriver/simulation/speed" value="{speed}"/></launch>')
            command += " speed.launch"
        log = f"{len(os.listdir(self.folder))}.log"
        self.started.append(self.open(self.here(command), log))
        self.until(self.started[-1], entry["until"], self.folder / log)

    def until(self, process, check, log):
        """Waits until the command of `check` succeeds; without one, until the process has printed the
        expected text."""
        deadline = time.monotonic() + BOUND
        while True:
            try:
                return self.run(check, check.get("run", f"cat {log.name}"))
            except Failed as failed:
                if process.poll() is not None or time.monotonic() > deadline:
                    output = log.read_text(errors="replace")
                    raise Failed(f"{failed}\nIt said:\n{output}") from failed
            time.sleep(0.2)

    def end(self):
        """Presses Ctrl-C in each terminal, the newest first."""
        while self.started:
            self.end_one(self.started.pop())

    def end_one(self, process):
        for number, seconds in ((signal.SIGINT, 30), (signal.SIGKILL, 10)):
            if lives(process.pid):
                os.killpg(process.pid, number)
            deadline = time.monotonic() + seconds
            while lives(process.pid) and time.monotonic() < deadline:
                time.sleep(0.05)
        process.wait()

    def follow(self, entries):
        """Returns a text for each command that failed, and the number of commands that ran."""
        wrong, ran = [], 0
        if all("elsewhere" in entry for entry in entries):
            return wrong, ran
        try:
            self.begin()
            for entry in entries:
                [(kind, command)] = [
                    (kind, entry[kind]) for kind in ("run", "start", "elsewhere") if kind in entry
                ]
                if kind == "elsewhere":
                    continue
                began = time.monotonic()
                if entry.get("after") == "Ctrl-C":
                    self.end()
                try:
                    getattr(self, kind)(entry, command)
                except (Failed, subprocess.TimeoutExpired) as failed:
                    wrong.append(f"{self.name}: {command}\n{failed}")
                ran += 1
                print(f"{self.name}: {time.monotonic() - began:4.1f} s  {command}", flush=True)
        finally:
            self.end()
            self.end_one(self.master)
        return wrong, ran


def follow(page, entries):
    with tempfile.TemporaryDirectory(prefix="stepdriver-docs-") as folder:
        return Page(page, pathlib.Path(folder)).follow(entries)


def main():
    # As in a terminal. If this runs in the background, the signal may be ignored, and programs inherit
    # that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    table = yaml.safe_load(TABLE.read_text(encoding="utf-8"))
    wanted = sys.argv[1:] or pages.names()
    with concurrent.futures.ThreadPoolExecutor(5) as readers:
        done = list(readers.map(lambda page: follow(page, table.get(page, [])), wanted))
    wrong = [text for texts, _ in done for text in texts]
    for text in wrong:
        print(f"FAILED: {text}", file=sys.stderr)
    total = sum(len(table.get(page, [])) for page in wanted)
    ran = sum(count for _, count in done)
    print(f"{total} commands on {len(wanted)} pages: {ran} run here, {total - ran} elsewhere, "
          f"{len(wrong)} failures")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
