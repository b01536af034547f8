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
apt_install() { apt_install_within 3600 "$@"; }

# apt_install_within SECONDS PACKAGE...: gives up when they are over, of which a quarter at most is for
# the lists of packages; these are fetched once.
apt_install_within() {
  local patience=$1 end=$((SECONDS + $1)) options=(-y --no-install-recommends) output
  shift
  command -v apt-get > /dev/null && as_root true || return 1
  say "apt-get install $*"
  if [ -z "${apt_lists:-}" ]; then
    apt_lists=fetched
    until_time $((SECONDS + patience / 4)) apt-get update > /dev/null 2>&1 || true
  fi
  # Downloaded first: a download that is too slow leaves nothing half installed.
  output=$(until_time "$end" apt-get install "${options[@]}" --download-only "$@" 2>&1 &&
    until_time "$end" env DEBIAN_FRONTEND=noninteractive \
      apt-get install "${options[@]}" "$@" 2>&1) && return
  printf '%s\n' "$output" | grep '^E:' >&2 || true
  return 1
}

# until_time END COMMAND...: runs it as root, and ends it when the shell's SECONDS reach END.
until_time() {
  local left=$(($1 - SECONDS))
  shift
  [ "$left" -gt 0 ] && as_root timeout -k 5 "$left" "$@"
}
