#!/usr/bin/env bash
# Creates the virtual environment VENV (first argument) and installs burg_drake in it, editable,
# with the development tools. Uses apt for what the system lacks if that needs no password.
# With LOWEST=1 it takes the oldest versions that pyproject.toml allows of all that it names, except
# Blender, which is large.
set -euo pipefail
cd "$(dirname "$0")/../.."
venv=${1:?usage: set_up.sh VENV}
# shellcheck source=tools/setup/apt.sh
. tools/setup/apt.sh

fail() { printf 'set-up: %s\n' "$*" >&2; exit 2; }

# Drake publishes wheels for macOS from Python 3.13 on.
if [ "$(uname -s)" = Darwin ]; then oldest=13; else oldest=11; fi

recent_enough() {
  "$1" -c "import sys; sys.exit(sys.version_info < (3, $oldest))" 2> /dev/null
}

pick_python() {
  local candidate
  if [ -n "${PYTHON:-}" ]; then
    recent_enough "$PYTHON" || fail "PYTHON=$PYTHON is not a Python 3.$oldest or later"
    echo "$PYTHON"
    return
  fi
  for candidate in python3 python3.13 python3.12 python3.11; do
    if recent_enough "$candidate"; then
      echo "$candidate"
      return
    fi
  done
  fail "no Python 3.$oldest or later found (tried python3, python3.13, python3.12, python3.11);" \
    "install one, or name it: make setup PYTHON=/path/to/python3"
}

has_pip() { "$venv/bin/python" -c 'import pip' 2> /dev/null; }

# Debian and Ubuntu ship python3 without ensurepip, hence these several ways.
create_venv() {
  local python=$1 package
  rm -rf "$venv"
  if ! "$python" -c 'import ensurepip, venv' 2> /dev/null; then
    package=$("$python" -c 'import sys; print("python3.%d-venv" % sys.version_info[1])')
    if ! apt_install "$package"; then
      create_venv_without_ensurepip "$python" && return
      fail "$python cannot create virtual environments; run: sudo apt-get install $package"
    fi
  fi
  "$python" -m venv "$venv" || fail "$python -m venv $venv failed"
}

create_venv_without_ensurepip() {
  local python=$1
  if "$python" -m virtualenv --version > /dev/null 2>&1; then
    "$python" -m virtualenv -q "$venv" && return
  fi
  "$python" -m venv --without-pip "$venv" 2> /dev/null || return 1
  if "$python" -m pip --version > /dev/null 2>&1; then
    "$python" -m pip --python "$venv/bin/python" install -q pip && return
  fi
  rm -rf "$venv"
  return 1
}

# Only rendering needs most of them: what stays missing is named in one line, and set-up goes on.
# Without GLib pydrake cannot even be imported (exit code 2): that ends it.
install_system_libraries() {
  local packages status=0
  packages=$("$venv/bin/python" -m burg_drake.system_libraries --packages) || true
  [ -z "$packages" ] && return
  # shellcheck disable=SC2086
  apt_install $packages || true
  "$venv/bin/python" -m burg_drake.system_libraries >&2 || status=$?
  [ "$status" -ne 2 ] || exit 2
}

if ! { recent_enough "$venv/bin/python" && has_pip; }; then
  python=$(pick_python)
  say "creating $venv with $("$python" --version)"
  create_venv "$python"
fi

say "installing burg_drake and what it needs into $venv (Drake is large: this takes a minute or more)"
quiet=(-q)
[ -t 1 ] && quiet=()
pip_install() {
  "$venv/bin/python" -m pip install ${quiet[@]+"${quiet[@]}" -q} --disable-pip-version-check "$@"
}
uv_install() {
  "$venv/bin/python" -m uv pip install ${quiet[@]+"${quiet[@]}"} --system-certs \
    --python "$venv/bin/python" "$@"
}
pip_install uv || say "uv cannot be installed"
if [ -n "${LOWEST:-}" ]; then  # pip takes the newest versions alone
  if ! "$venv/bin/python" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))'; then
    rm -rf "$venv"
    fail "the oldest versions are for Python 3.11 alone; name one:" \
      "make test-lowest PYTHON=/path/to/python3.11"
  fi
  uv_install --resolution lowest-direct -e '.[dask,dev,frame,jobqueue,mujoco,parquet,ui,usd]'
# uv takes seconds where pip takes minutes, but knows no index that only pip's configuration names.
elif ! uv_install -e '.[dev,gpu,ui]'; then
  say "uv cannot install it; trying pip"
  pip_install -e '.[dev,gpu,ui]'
fi

install_system_libraries
say "done: $("$venv/bin/python" -c 'import importlib.metadata as m; print("drake", m.version("drake"))') in $venv"
