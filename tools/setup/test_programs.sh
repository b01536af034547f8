#!/usr/bin/env bash
# Installs the programs that some tests need: Chromium for pages and ROS 1 where apt is at hand and
# needs no password, ROS 2 from wheels. Without them those tests skip and say so.
set -euo pipefail
cd "$(dirname "$0")/../.."
# shellcheck source=tools/setup/apt.sh
. tools/setup/apt.sh

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

# ROS 2 is in wheels for Python 3.11 on Linux. They hook into every start of Python, hence an
# environment of their own; the tests add the packages of theirs.
ros2=.venv-ros2
if [ ! -e "$ros2/.set-up" ] && [ "$(uname -s)" = Linux ] &&
  .venv/bin/python -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2> /dev/null; then
  rm -rf "$ros2"
  if .venv/bin/python -m venv --without-pip "$ros2" &&
    .venv/bin/python -m pip --python "$ros2/bin/python" install -q --disable-pip-version-check \
      'ros-rclpy[fastrtps]==9.1.*' ros-sensor-msgs ros-geometry-msgs ros-std-msgs; then
    touch "$ros2/.set-up"
  else
    rm -rf "$ros2"
    say "no ROS 2: the test that needs it skips"
  fi
fi
