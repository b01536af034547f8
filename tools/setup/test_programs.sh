#!/usr/bin/env bash
# Installs the programs that some tests hold burg_drake against, where apt is at hand and needs no
# password: ROS 1 for the ROS node. Without them those tests skip and say so.
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

want "ROS 1" python3-rospy python3-rosmaster python3-cv-bridge python3-sensor-msgs \
  python3-geometry-msgs python3-tf2-msgs
