#!/usr/bin/env python3
"""Checks that the links, files, messages and launch arguments in the pages exist, and that no line is too long.

usage: test/docs/links_test.py

Exit code 0: nothing is wrong; 1: otherwise.
"""

import re
import sys

import pages

MOST_COLUMNS = 120

ROOMS = ("activity", "axis", "config", "driver", "geometry", "gpio", "kinematics", "machine", "math", "motor",
         "path_timing", "point_to_point", "profile", "pulse", "setup", "sim", "trajectory")
ENDINGS = "cpp|h|launch|md|msg|py|rst|rules|sh|srv|svg|test|txt|urdf|yaml"


def anchors(page):
    """The anchors of a page's headings."""
    for line in pages.prose(pages.text_of(page)).splitlines():
        if line.startswith("#"):
            heading = line.strip("# ").lower()
            yield re.sub(r"[^\w -]", "", heading).replace(" ", "-")


def broken_links(page):
    for target in re.findall(r"\]\(([^)]+)\)", pages.prose(pages.text_of(page))):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        there = ((pages.ROOT / page).parent / path).resolve() if path else pages.ROOT / page
        if not there.exists():
            yield f"the link {target}"
        elif anchor and anchor not in anchors(there.relative_to(pages.ROOT)):
            yield f"the heading of the link {target}"


def is_there(name, files):
    if name.split("/")[0] in ROOMS:
        if not re.search(r"/$|\.(h|cpp)$", name):
            return True  # a parameter: `gpio/backend`
        place = rf"stepdriver_core/(include/stepdriver_core|src)/{re.escape(name)}"
        # There is also a folder config/ outside the core.
        return any(re.search(place, file) for file in files) or (pages.ROOT / name).exists()
    if "/" not in name:
        return any(file.endswith(f"/{name}") for file in files)
    # A program is found by its source.
    return any(list(pages.ROOT.glob(name.rstrip("/") + ending)) for ending in ("", ".cpp"))


def missing_files(page, files):
    tops = {file.split("/")[0] for file in files if "/" in file} | set(ROOMS)
    for quoted in re.findall(r"`([^`\s]+)`", pages.prose(pages.text_of(page))):
        name = quoted.rstrip(":,")
        is_path = re.fullmatch(r"[\w.*-]+(/[\w.*-]+)*/?", name) and "..." not in name
        is_file = re.fullmatch(rf"[\w-]+\.({ENDINGS})", name)
        if not is_path or not (name.split("/")[0] in tops and "/" in name or is_file):
            continue
        if not is_there(name, files):
            yield f"the file {name}"


def unsaid_messages():
    """Messages in the first column of troubleshooting.md that no program prints."""
    page = "docs/troubleshooting.md"
    sources = "".join(
        file.read_text(encoding="utf-8")
        for folder in ("stepdriver_core/src", "stepdriver_ros/src")
        for file in (pages.ROOT / folder).rglob("*.cpp")
    )
    sources = re.sub(r'"\s*\n\s*"', "", sources)
    for _, rows in pages.tables(pages.text_of(page)):
        quoted = [text for row in rows for text in re.findall(r"`([^`]+)`", row[0])]
        for message in quoted:
            if " " not in message or re.fullmatch(r"\w+: \w+", message):
                continue  # a name, or the value of a field
            for part in re.split(r"\.\.\.;?", message):
                if part.strip() not in sources:
                    yield f"{page}: the message {message}"


def wrong_arguments():
    """Arguments that are only in a launch file, or only in the table of interfaces.md."""
    page, heading, said = "docs/interfaces.md", "Launch files", set()
    [rows] = [rows for under, rows in pages.tables(pages.text_of(page)) if under == heading]
    for file, _, text in rows[1:]:
        file = file.strip("`")
        launch = (pages.ROOT / "launch" / file).read_text(encoding="utf-8")
        arguments = set(re.findall(r'^  <arg name="(\w+)"', launch, re.M))
        if "the same" not in text:
            said = set(re.findall(r"`(\w+)` \(", text))
        for argument in sorted(said ^ arguments):
            yield f"{page}: the argument {argument} of {file}"


def long_lines(page):
    for number, line in enumerate(pages.text_of(page).splitlines(), 1):
        if len(line) > MOST_COLUMNS and not line.startswith("|"):
            yield f"{page}:{number} has {len(line)} columns; {MOST_COLUMNS} are allowed"


def main():
    # Files of the reader, and generated folders.
    of_reader = {"my_axis.yaml", "my_axes.yaml", "NAME.yaml", "controllers.yaml"}
    made = re.compile(r"build.*|\.git")
    tops = [top for top in pages.ROOT.iterdir() if top.is_dir() and not made.fullmatch(top.name)]
    files = [
        str(file.relative_to(pages.ROOT)) for top in tops for file in top.rglob("*") if file.is_file()
    ]
    wrong = [
        f"{page}: {what} isn't there"
        for page in pages.names()
        for what in list(broken_links(page)) + list(missing_files(page, files))
        if what.split("/")[-1].split(" ")[-1] not in of_reader
    ]
    wrong += [f"{message} isn't there" for message in unsaid_messages()]
    wrong += [f"{argument} isn't both there and on the page" for argument in wrong_arguments()]
    wrong += [line for page in pages.names() for line in long_lines(page)]
    for text in wrong:
        print(f"FAILED: {text}", file=sys.stderr)
    print(f"{len(pages.names())} pages, {len(wrong)} faults in links, files, messages and lines")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
