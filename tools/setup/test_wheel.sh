#!/usr/bin/env bash
# Builds sdist and wheel, installs the wheel into VENV-wheel and runs the tests against that.
# Usage: test_wheel.sh VENV [PYTEST ARGUMENT...]; VENV lends its installed dependencies.
set -euo pipefail
cd "$(dirname "$0")/../.."
venv=$(cd "${1:?usage: test_wheel.sh VENV [PYTEST ARGUMENT...]}" && pwd)
shift
wheel_venv=$venv-wheel
wheels=$(mktemp -d)
trap 'rm -rf "$wheels"' EXIT

# The wheel is built from the sdist, so that both are known to be complete.
"$venv/bin/python" -m build --no-isolation --outdir "$wheels" . > "$wheels/log" 2>&1 || {
  cat "$wheels/log" >&2
  exit 1
}
rm -rf "$wheel_venv"
"$venv/bin/python" -m venv --without-pip "$wheel_venv"
"$venv/bin/python" -m pip --python "$wheel_venv/bin/python" install -q --no-deps --no-index \
  --disable-pip-version-check "$wheels"/*.whl

# A directory that a .pth file names joins sys.path, but the .pth files in it are not read: the
# dependencies of VENV are lent, its editable burg_drake is not.
site_packages() { "$1" -c 'import sysconfig; print(sysconfig.get_path("purelib"))'; }
site_packages "$venv/bin/python" > "$(site_packages "$wheel_venv/bin/python")/lent.pth"
"$venv/bin/python" -m pip --python "$wheel_venv/bin/python" check --disable-pip-version-check

# PYTHONSAFEPATH keeps the checkout off sys.path, in processes that tests start too.
unset PYTHONPATH
export PYTHONSAFEPATH=1 BURG_TEST_WHEEL=1
"$wheel_venv/bin/python" -m pytest "$@"
