# shellcheck shell=bash
# Sourced by the scripts beside it: Debian's packages, where installing them needs no password.

say() { printf 'set-up: %s\n' "$*"; }

# as_root COMMAND...: runs it as root; false if this user may not.
as_root() {
  if [ "$(id -u)" -eq 0 ]; then
    "$@"
  else
    sudo -n true 2> /dev/null && sudo -n "$@"
  fi
}

# apt_install PACKAGE...: true if they are installed now; false if this user may not, or apt failed.
apt_install() { apt_install_within 1h "$@"; }

# apt_install_within TIME PACKAGE...: gives up, before anything is installed, if the download takes
# longer.
apt_install_within() {
  local patience=$1 options=(-y --no-install-recommends) output
  shift
  command -v apt-get > /dev/null && as_root true || return 1
  say "apt-get install $*"
  as_root timeout "$patience" apt-get update > /dev/null 2>&1 || true
  output=$(as_root timeout "$patience" apt-get install "${options[@]}" --download-only "$@" 2>&1 &&
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install "${options[@]}" "$@" 2>&1) && return
  printf '%s\n' "$output" | grep '^E:' >&2 || true
  return 1
}
