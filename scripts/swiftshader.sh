#!/bin/sh
# Puts SwiftShader, a second software Vulkan, into the folder given, with the file by which the Vulkan loader finds it. It is
# an archive of 3 MB in an npm package of Chromium for servers; where there is no npm, it comes from Debian's Chromium.
set -eu

PACKAGE=@sparticuz/chromium@147.0.0

[ "$(uname -s)-$(uname -m)" = Linux-x86_64 ] || { echo "SwiftShader is fetched for Linux on x86-64 alone." >&2; exit 1; }
mkdir -p "$1"
folder=$(cd "$1" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
if command -v npm >/dev/null && command -v node >/dev/null; then
    tar -xzf "$(npm pack --silent "$PACKAGE")" package/bin/swiftshader.tar.br
    node -e 'const fs = require("fs"), zlib = require("zlib");
        fs.writeFileSync("swiftshader.tar", zlib.brotliDecompressSync(fs.readFileSync("package/bin/swiftshader.tar.br")))'
    tar -xf swiftshader.tar
elif command -v apt-get >/dev/null; then
    apt-get download -qq chromium >/dev/null
    dpkg-deb -x chromium_*.deb .
else
    echo "npm with Node.js is needed: install them." >&2
    exit 1
fi
cp "$(find . -name libvk_swiftshader.so | head -n 1)" "$folder/"
cat >"$folder/vk_swiftshader_icd.json" <<EOF
{"file_format_version": "1.0.0", "ICD": {"library_path": "$folder/libvk_swiftshader.so", "api_version": "1.0.5"}}
EOF
