#!/usr/bin/env bash
# Builds the page into target/page: the library as WebAssembly, with its glue, and the files of web/page as they are.
# Takes rustup's wasm32 target where it is there or can be fetched, else Debian's compiler for the web (rustc-web), which
# builds its own standard library.
set -euo pipefail
cd "$(dirname "$0")/.."
out=target/page
target=wasm32-unknown-unknown
module=target/$target/web/spectroll_web.wasm
# Every browser that has WebGPU, and all others of this decade, have 128-bit vectors. One panic ends one worker.
export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS="-Ctarget-feature=+simd128"

build() {
	cargo build --locked --profile web -p spectroll-web --target $target "$@"
}

has_target() { rustup target list --installed 2>/dev/null | grep -q "^$target$"; }
is_for_web() { dpkg -s rustc-web rust-web-src >/dev/null 2>&1; }

if has_target; then
	build
elif ! is_for_web && command -v rustup >/dev/null && rustup target add $target 2>/dev/null; then
	build
else
	if ! is_for_web; then
		echo "installing Debian's rustc-web, since rustup has no target $target" >&2
		apt-get update -qq && apt-get install -qq -y --no-install-recommends rustc-web rust-web-src
	fi
	linker=$(command -v rust-lld || command -v wasm-ld || find "$(rustc --print sysroot)" -name rust-lld | head -1)
	export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$linker
	# The standard library is built with the page, for which Cargo needs leave.
	RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1 build -Zbuild-std=std,panic_abort
fi

# The glue must be made by the very version that the lock file has.
version=$(sed -n '/^name = "wasm-bindgen"$/{n;s/version = "\(.*\)"/\1/p}' Cargo.lock)
bindgen=target/web-tools/bin/wasm-bindgen
if ! "$bindgen" --version 2>/dev/null | grep -q " $version$"; then
	cargo install --quiet wasm-bindgen-cli --version "$version" --no-default-features --root target/web-tools \
		--target-dir target/web-tools-build
fi

rm -rf "$out"
mkdir -p "$out"
cp -R web/page/. "$out/"
"$bindgen" --target web --no-typescript --remove-name-section --out-dir "$out/library" --out-name spectroll "$module"
bytes=$(cd "$out" && find . -type f -print0 | sort -z | xargs -0 -n1 gzip -9c | wc -c)
echo "$out: $bytes bytes by gzip"
