#!/usr/bin/env bash
# Checks the annotations of the Python package, and a program that uses it, with mypy; and _core.pyi against
# the compiled module.
set -euo pipefail

usage() { printf 'usage: test/python/types_test.sh FOLDER\n\nFOLDER contains the package stepdriver_core.\n'; }
case ${1:-} in
  -h | --help) usage && exit ;;
esac
(($# == 1)) || { usage >&2 && exit 2; }
here=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd -P)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export MYPYPATH=$1 PYTHONPATH=$1 MYPY_CACHE_DIR=$scratch/cache PYTHONDONTWRITEBYTECODE=1

mypy --strict --ignore-missing-imports -p stepdriver_core
mypy --strict "$here/typed_program.py"
if mypy --strict "$here/wrongly_typed_program.py" >"$scratch/wrong"; then
  printf 'FAILED: mypy finds nothing wrong with wrongly_typed_program.py\n' >&2
  exit 1
fi
grep -qF 'Found 3 errors' "$scratch/wrong" || { cat "$scratch/wrong" >&2 && exit 1; }
cat >"$scratch/mypy.ini" <<'END'
[mypy]
[mypy-matplotlib.*]
ignore_missing_imports = True
END
stubtest stepdriver_core._core --mypy-config-file "$scratch/mypy.ini" --allowlist "$here/stubtest_allowed.txt"
