#!/bin/sh
# Makes sure that there is a Vulkan driver: installs Mesa's software one on Debian and Ubuntu, says what to do elsewhere.
set -eu

PATH=$PATH:/usr/sbin:/sbin # where ldconfig is

has_driver() {
    [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] && return 0
    for folder in /usr/share/vulkan/icd.d /etc/vulkan/icd.d /usr/local/share/vulkan/icd.d; do
        for file in "$folder"/*.json; do
            [ -e "$file" ] && ldconfig -p | grep -q libvulkan.so.1 && return 0
        done
    done
    return 1
}

[ "$(uname -s)" = Linux ] || exit 0 # macOS and Windows come with Metal and DirectX 12
has_driver && exit 0
if ! command -v apt-get >/dev/null; then
    echo "No Vulkan driver was found. Install one: Fedora: mesa-vulkan-drivers vulkan-loader; Arch: vulkan-swrast." >&2
    exit 1
fi
root=$([ "$(id -u)" = 0 ] || echo sudo)
echo "No Vulkan driver was found: installing Mesa's."
$root apt-get update -qq
DEBIAN_FRONTEND=noninteractive $root apt-get install -y -qq libvulkan1 mesa-vulkan-drivers >/dev/null
