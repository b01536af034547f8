#!/usr/bin/env bash
# Runs examples, as many at a time as there are processors, each in a scratch directory of its own,
# without a display or an input. Usage: run_examples.sh PYTHON EXAMPLE...
set -euo pipefail
python=$(cd "$(dirname "${1:?usage: run_examples.sh PYTHON EXAMPLE...}")" && pwd)/$(basename "$1")
shift
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
unset DISPLAY

# run EXAMPLE: one line about it; its output, too, if it fails.
run() {
  local path=$PWD/$1 folder
  folder=$scratch/$(basename "$1")
  mkdir "$folder"
  SECONDS=0
  if (cd "$folder" && "$python" "$path" > "$folder.output" 2>&1 < /dev/null); then
    printf '%-50s ok %4d s\n' "$1" "$SECONDS"
  else
    { printf '%-50s FAILED\n' "$1" && sed 's/^/    /' "$folder.output"; } > "$folder.report"
    cat "$folder.report"
    return 1
  fi
}

export python scratch
export -f run
printf '%s\0' "$@" | xargs -0 -n 1 -P "$(getconf _NPROCESSORS_ONLN)" bash -c 'run "$1"' run
