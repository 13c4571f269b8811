#!/usr/bin/env bash
# Makes the manual of the core's public headers, and reports mistakes in their comments.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() {
  cat <<'END'
usage: scripts/doxygen.sh

Installs doxygen if it is missing, and makes a manual of stepdriver_core/include in build/doxygen/html.
Exit code 0: there is no warning; every class, struct and enumeration has a comment; and everything
that comments name, such as Machine::stop(), exists. A member whose name says everything needs no
comment.
END
}

case ${1:-} in
  '') ;;
  -h | --help) usage && exit ;;
  *) usage >&2 && exit 2 ;;
esac

# doxygen_warnings [SETTING=VALUE...]: runs doxygen, and prints its warnings; it calls some of them errors.
doxygen_warnings() {
  {
    cat "$root/Doxyfile"
    printf '%s\n' "OUTPUT_DIRECTORY=\"$build/doxygen\"" "STRIP_FROM_PATH=\"$src\"" "$@"
  } >"$build/doxygen/Doxyfile"
  SRC=$src doxygen "$build/doxygen/Doxyfile" 2>&1 || true
}

# The names in comments, such as Machine::stop(), that don't exist.
dead_names() {
  local include=$root/stepdriver_core/include
  # A test compiles the examples.
  find "$include" -name '*.h' -exec sed '/@code/,/@endcode/d' {} + | grep -oE '///.*' | grep -oE '\b[A-Z][A-Za-z]*::[A-Za-z_]+' | sort -u |
    grep -vxFf <(awk -F '[<>]' '
      /<compound / { compound = "" }
      /<member / { member = 1 }
      /<name>/ && compound == "" { compound = $3; sub(/.*::/, "", compound); next }
      /<name>/ && member { print compound "::" $3; member = 0 }' "$build/doxygen/tags") |
    while IFS= read -r name; do
      grep -rnF "$name" "$include" | sed "s|^$root/\([^:]*:[0-9]*\):.*|\1: warning: there is no $name|"
    done
}

choose_build_folder
install_packages lint
rm -rf "$build/doxygen"
mkdir -p "$build/doxygen"

warnings=$(
  doxygen_warnings "GENERATE_TAGFILE=\"$build/doxygen/tags\""
  dead_names
  doxygen_warnings EXTRACT_ALL=NO GENERATE_HTML=NO |
    grep -E 'Compound .* is not documented|\(enumeration\) .* is not documented' || true
)
[[ -z $warnings ]] || say "$warnings"
say "doxygen $(doxygen --version): $(grep -cE '(warning|error): ' <<<"$warnings" || true) warnings"
[[ -z $warnings && -s $build/doxygen/html/index.html ]] || die "correct the comments that are listed above"
say "The manual: $build/doxygen/html/index.html"
