#!/usr/bin/python3
"""Prints the table of bench/figures.txt from the JSON files of the benchmarks.

bench.sh calls it: bench_table.py FIGURES.TXT TABLE.JSON RESULT.JSON...

Exit code 0: no benchmark failed, and every target that was measured is met.
"""

import json
import re
import statistics
import sys

QUANTITY = re.compile(r"\{([^{}]+):([a-z0-9_]+)\}")


def read_results(names):
    """The values of each field of each benchmark, and the messages of those that failed."""
    values, failed = {}, []
    for name in names:
        with open(name) as file:
            for run in json.load(file)["benchmarks"]:
                if run.get("run_type") == "aggregate":
                    continue
                key = re.sub("/iterations:[0-9]+", "", run.get("run_name", run["name"]))
                if run.get("error_occurred"):
                    failed.append(f"{key}: {run['error_message']}")
                if "items_per_second" in run:
                    run["ns"] = 1e9 / run["items_per_second"]
                for field, value in run.items():
                    if isinstance(value, (int, float)):
                        values.setdefault((key, field), []).append(value)
    return values, failed


def read_figures(name):
    with open(name) as file:
        for line in file:
            if line.strip() and not line.startswith("#"):
                yield [part.strip() for part in line.split("|")]


def measured(expression, values):
    """None if one of the benchmarks has not run."""
    if any(found not in values for found in QUANTITY.findall(expression)):
        return None
    medians = QUANTITY.sub(lambda found: repr(statistics.median(values[found.groups()])), expression)
    if re.search(r"[^-+*/(). e0-9]", medians):
        sys.exit(f"{expression}: not an expression of figures")
    return eval(medians)  # contains only numbers and operators


def verdict(target, value):
    if value is None:
        return "not run"
    if target == "-":
        return ""
    sign, number = target.split()
    met = value <= float(number) if sign == "<=" else value >= float(number)
    return "met" if met else "MISSED"


def shown(value):
    if value is None:
        return "-"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def main():
    figures, table, *results = sys.argv[1:]
    values, failed = read_results(results)
    rows = []
    for figure, target, expression, unit in read_figures(figures):
        value = measured(expression, values)
        rows.append({"figure": figure, "target": target, "measured": value, "unit": unit,
                     "verdict": verdict(target, value)})
    with open(table, "w") as file:
        json.dump({"figures": rows, "failed": failed}, file, indent=1)
    width = max(len(row["figure"]) for row in rows)
    print(f"{'figure':{width}} | target  | measured          | met or missed")
    print(f"{'-' * width} | ------- | ----------------- | -------------")
    for row in rows:
        value = f"{shown(row['measured'])} {row['unit']}".strip()
        print(f"{row['figure']:{width}} | {row['target']:7} | {value:17} | {row['verdict']}".rstrip())
    for failure in failed:
        print(f"FAILED: {failure}")
    sys.exit(bool(failed) or any(row["verdict"] == "MISSED" for row in rows))


main()
