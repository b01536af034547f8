#!/usr/bin/env bash
# Installs the programs that some tests need, where apt is at hand and needs no password: Chromium for
# pages, ROS 1 for the ROS node. Without them those tests skip and say so.
set -euo pipefail
# shellcheck source=tools/setup/apt.sh
. "$(dirname "$0")/apt.sh"

patience=240  # seconds for all of it; the tests have to be done in time, too

# want NAME PACKAGE...: installs the packages, if there is time left for it.
want() {
  local name=$1 missing=() package
  shift
  for package in "$@"; do
    dpkg -s "$package" > /dev/null 2>&1 || missing+=("$package")
  done
  [ ${#missing[@]} -gt 0 ] || return 0
  apt_install_within $((patience - SECONDS)) "${missing[@]}" ||
    say "no $name: tests that need it skip (missing: ${missing[*]})"
}

# Some 80 MB, and as much of libraries where nothing with a window is installed. Ubuntu's package of
# that name only fetches a snap, which no test can use.
if ! command -v chromium chromium-browser google-chrome > /dev/null; then
  grep -q '^ID=ubuntu' /etc/os-release || want Chromium chromium
fi

want "ROS 1" python3-rospy python3-rosmaster python3-cv-bridge python3-sensor-msgs \
  python3-geometry-msgs python3-tf2-msgs
