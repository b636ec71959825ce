#!/bin/sh
# A browser for the tests of the page, and the tool that drives it: what is missing is installed on Debian and Ubuntu, and
# named elsewhere.
set -e

browser=${CHROMIUM:-$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)}
if [ -z "$browser" ]; then
	command -v apt-get >/dev/null || { echo "install Chromium, or name one in CHROMIUM" >&2; exit 1; }
	sudo=$([ "$(id -u)" = 0 ] || echo sudo)
	$sudo apt-get update -qq
	$sudo apt-get install -qq -y --no-install-recommends chromium
fi
command -v npm >/dev/null || { echo "install Node.js 20 or newer, with npm" >&2; exit 1; }
