#!/usr/bin/env bash
# Installs what `sutura-view` needs to run on Debian and its kin: a Vulkan driver (in software, where there is no graphics processor), the libraries
# with which it opens a window, and a display without a screen to try that. Nothing is installed where everything is there. Nothing is needed to build.
set -euo pipefail

packages=(mesa-vulkan-drivers libvulkan1 libxkbcommon-x11-0 libx11-6 libx11-xcb1 libxcursor1 libxi6 libxrandr2 xvfb xauth)

if ! command -v dpkg-query >/dev/null; then
    echo "not a Debian system: a Vulkan driver and the libraries of X11 are up to you (${packages[*]})"
    exit 0
fi

missing=()
for package in "${packages[@]}"; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
done
[ "${#missing[@]}" -eq 0 ] && exit 0

run=()
[ "$(id -u)" -eq 0 ] || run=(sudo)
"${run[@]}" apt-get update -q
DEBIAN_FRONTEND=noninteractive "${run[@]}" apt-get install -q -y --no-install-recommends "${missing[@]}"
