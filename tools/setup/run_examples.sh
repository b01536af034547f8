#!/usr/bin/env bash
# Runs examples one after the other in a scratch directory, without a display or an input.
# Usage: run_examples.sh PYTHON EXAMPLE...
set -euo pipefail
python=$(cd "$(dirname "${1:?usage: run_examples.sh PYTHON EXAMPLE...}")" && pwd)/$(basename "$1")
shift
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
unset DISPLAY

failed=()
for example in "$@"; do
  path=$PWD/$example
  SECONDS=0
  if (cd "$scratch" && "$python" "$path" > "$scratch/output" 2>&1 < /dev/null); then
    printf '%-50s ok %4d s\n' "$example" "$SECONDS"
  else
    printf '%-50s FAILED\n' "$example"
    sed 's/^/    /' "$scratch/output"
    failed+=("$example")
  fi
done
[ ${#failed[@]} -eq 0 ]
