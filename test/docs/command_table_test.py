#!/usr/bin/env python3
"""Checks that commands.yaml has the commands of each page, in order.

usage: test/docs/command_table_test.py

commands_test.py runs those commands. This takes a second, and needs no build. Exit code 0: the table has
them all; 1: otherwise.
"""

import re
import sys

import yaml

import pages

TABLE = pages.ROOT / "test/docs/commands.yaml"


def differences(page, entries):
    """Differences between the table and the page."""
    on_page = list(pages.commands(pages.text_of(page)))
    in_table = [
        entry.get("run") or entry.get("start") or entry["elsewhere"]
        for entry in entries if not entry.get("unsaid")
    ]
    for command in on_page:
        if command not in in_table:
            yield f"{page}: nothing runs this command, see {TABLE.name}: {command}"
    for command in in_table:
        if command not in on_page:
            yield f"{page}: {TABLE.name} has a command that isn't there: {command}"
    if sorted(on_page) == sorted(in_table) and on_page != in_table:
        yield f"{page}: {TABLE.name} has the commands in another order"
    if len(on_page) != len(in_table) and set(on_page) == set(in_table):
        yield f"{page}: {TABLE.name} has a command more or less often"


def stages():
    """The stages of scripts/test.sh, and their parts: "core", "core tests"."""
    stage = ""
    for kind, name in re.findall(
        r"^ *(?:.* \|\| )?(stage|part) ([\w-]+)", (pages.ROOT / "scripts/test.sh").read_text(), re.M
    ):
        if kind == "stage":
            stage = name
        yield name if kind == "stage" else f"{stage} {name}"


def untested(page, entries):
    """Commands that are marked as tested elsewhere, but without a reason or an existing test."""
    known = set(stages())
    for entry in entries:
        if "elsewhere" not in entry:
            continue
        if not entry.get("why"):
            yield f"{page}: no reason why this isn't run: {entry['elsewhere']}"
        by = entry.get("by")
        if by and by not in known and not (pages.ROOT / by).exists():
            yield f"{page}: there is no stage or file {by}, for: {entry['elsewhere']}"


def main():
    table = yaml.safe_load(TABLE.read_text(encoding="utf-8"))
    wrong = [f"{TABLE.name}: there is no page {page}" for page in table if page not in pages.names()]
    for page in pages.names():
        wrong += differences(page, table.get(page, []))
        wrong += untested(page, table.get(page, []))
    for text in wrong:
        print(f"FAILED: {text}", file=sys.stderr)
    print(f"{sum(map(len, table.values()))} commands of {len(table)} pages: {len(wrong)} failures")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
