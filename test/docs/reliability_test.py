#!/usr/bin/env python3
"""Checks the tables of docs/reliability.md: each fault must have a test that exists.

usage: test/docs/reliability_test.py

The last column of a row names tests as `Suite.Name`, or scripts by their path. Exit code 0: each row is
complete, all tests exist, and there are enough faults; 1: otherwise.
"""

import re
import sys

import pages

PAGE = "docs/reliability.md"
COLUMNS = ["Fault", "What happens", "What is kept", "Test"]
LEAST_FAULTS = 60


def tests():
    """The names of all GoogleTests in the sources, as Suite.Name."""
    return {
        f"{suite}.{name}"
        for source in (pages.ROOT / "test").rglob("*.cpp")
        for suite, name in re.findall(
            r"^TEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\)", source.read_text(encoding="utf-8"), re.MULTILINE
        )
    }


def missing_tests(cell, there):
    """Yields what is wrong with the last cell of a row."""
    for name in cell.split(", "):
        quoted = re.fullmatch(r"`(test/[\w/]+\.(?:py|sh)|\w+\.\w+)`", name)
        if not quoted:
            yield f"{name} must be `Suite.Name` of a test, or the path of a script below test/, in backticks"
        elif "/" in name and not (pages.ROOT / quoted[1]).is_file():
            yield f"there is no script {quoted[1]}"
        elif "/" not in name and quoted[1] not in there:
            yield f"there is no test {quoted[1]}"


def problems(tables):
    there, faults = tests(), set()
    for heading, (columns, *rows) in tables:
        if columns != COLUMNS:
            yield f"{heading}: the columns are {', '.join(columns)}, but must be {', '.join(COLUMNS)}"
            continue
        for row in rows:
            place = f"{heading}: {row[0]}"
            if len(row) != len(COLUMNS) or not all(row):
                yield f"{place}: a row must have {len(COLUMNS)} cells, none of them empty"
                continue
            if row[0] in faults:
                yield f"{place}: the fault is in two rows"
            faults.add(row[0])
            for problem in missing_tests(row[-1], there):
                yield f"{place}: {problem}"
    if len(faults) < LEAST_FAULTS:
        yield f"there are {len(faults)} complete faults, but at least {LEAST_FAULTS} are required"


def main():
    tables = list(pages.tables(pages.text_of(PAGE)))
    wrong = list(problems(tables))
    for text in wrong:
        print(f"FAILED: {PAGE}: {text}", file=sys.stderr)
    print(f"{sum(len(rows) - 1 for _, rows in tables)} faults, {len(wrong)} problems")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
