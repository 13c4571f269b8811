#!/usr/bin/python3
"""Prints the table of bench/figures.txt from the JSON files of the benchmarks.

bench.sh calls it: bench_table.py FIGURES.TXT TABLE.JSON RESULT.JSON...
               or: bench_table.py --compare STORED_TABLE.JSON TABLE.JSON...

Exit code 0: no benchmark failed, and every target that was measured is met. With --compare: no ratio is
above that of the stored run by more than 25 % in all of the tables. Only ratios of two measurements are
compared, because a computer that is slower, or busy, changes both.
"""

import json
import re
import statistics
import sys

QUANTITY = re.compile(r"\{([^{}]+):([a-z0-9_]+)\}")
MOST_GROWTH = 1.25


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


def ratios(table):
    with open(table) as file:
        rows = json.load(file)["figures"]
    group, found = "", {}
    for row in rows:
        # "the same ..." is a figure of the one before it.
        if not row["figure"].startswith("the same"):
            group = row["figure"]
        if row["ratio"] and row["measured"] is not None:
            found[(group, row["figure"])] = row["measured"]
    return found


def compare(stored, *tables):
    before, runs = ratios(stored), [ratios(table) for table in tables]
    missing = [figure for group, figure in before if not all((group, figure) in run for run in runs)]
    if missing:
        sys.exit(f"not measured: {', '.join(missing)}")
    width = max(len(figure) for _, figure in before)
    print(f"{'ratio':{width}} | stored  | now, over the stored one")
    print(f"{'-' * width} | ------- | ------------------------")
    grown = 0
    for key in before:
        # 0 bytes over 0 bytes, or a stored 0, can't grow by a part.
        growths = [run[key] / before[key] if before[key] > 0 else 1.0 + run[key] for run in runs]
        above = all(growth > MOST_GROWTH for growth in growths)
        grown += above
        shown_growths = " ".join(f"{growth:.2f}" for growth in growths) + above * " GROWN"
        print(f"{key[1]:{width}} | {shown(before[key]):7} | {shown_growths}")
    return grown > 0


def main():
    if sys.argv[1] == "--compare":
        sys.exit(compare(*sys.argv[2:]))
    figures, table, *results = sys.argv[1:]
    values, failed = read_results(results)
    rows = []
    for figure, target, expression, unit in read_figures(figures):
        value = measured(expression, values)
        rows.append({"figure": figure, "target": target, "measured": value, "unit": unit,
                     "ratio": not unit and "} / {" in expression, "verdict": verdict(target, value)})
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
