#!/usr/bin/env bash
# Measures which lines of the core its tests run.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/coverage.sh

Installs what is missing, builds the core and its tests with the preset coverage, runs the tests, and
prints the part of the core's lines that ran: in all, and the files with the most lines that didn't. A page
with each line goes to build/coverage/lines.html. Exit code 0: the tests passed, and they ran 95 % of
the lines.

The adapter of the other version of libgpiod isn't compiled, and that of this version needs a GPIO chip: it
counts, but only the test kernel runs it (test/kernel). The longest random searches are left out.
END
}
case ${1:-} in
  '') ;;
  -h | --help) usage && exit ;;
  *) usage >&2 && exit 2 ;;
esac

choose_build_folder
install_packages core coverage
coverage=$build/coverage

configure_coverage() {
  discard_foreign_build "$src/stepdriver_core" "$coverage/core"
  (cd "$src/stepdriver_core" && cmake --preset coverage -B "$coverage/core")
}
quietly coverage-configure configure_coverage
say "Building (tail -f $build/log/coverage-build.log)"
quietly coverage-build cmake --build "$coverage/core" -j "$jobs"
find "$coverage/core" -name '*.gcda' -delete
status=0
# The library's own test installs it, and compiles without these options. The search takes hours here:
# fewer schedules run almost the same lines.
export STEPDRIVER_SCHEDULES=2000
quietly coverage-tests ctest --test-dir "$coverage/core" -j "$jobs" --timeout 900 --no-tests=error \
  --output-on-failure -E '^library$|RandomSequences|ForEachPairOfRequests' || status=$?

gcovr --root "$src" --filter "$src/stepdriver_core/" --object-directory "$coverage/core" -j "$jobs" \
  --gcov-ignore-parse-errors --exclude-unreachable-branches --json "$coverage/lines.json" \
  --html-details "$coverage/lines.html" --json-summary "$coverage/summary.json" "$coverage/core" \
  >"$build/log/coverage-gcovr.log" 2>&1 || die "gcovr failed: see $build/log/coverage-gcovr.log"
/usr/bin/python3 - "$coverage/summary.json" <<'END' || status=1
import json, sys
with open(sys.argv[1], encoding="utf-8") as file:
    summary = json.load(file)
files = sorted(summary["files"], key=lambda each: each["line_covered"] - each["line_total"])
print("lines that no test ran, by file:")
for each in files[:12]:
    missed = each["line_total"] - each["line_covered"]
    if missed:
        print(f"  {missed:4} of {each['line_total']:4}  {each['filename']}")
part = 100.0 * summary["line_covered"] / summary["line_total"]
print(f"{part:.1f} % of {summary['line_total']} lines ran")
sys.exit(part < 95.0)
END
((status == 0)) || die "a test failed, or less than 95 % of the lines ran"
