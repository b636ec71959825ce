# Each target does its own set-up: what is missing is installed on Debian and Ubuntu, and named elsewhere.
.PHONY: demo test test-swiftshader test-python web web-build web-test wheel notebook exhaustive faults fuzz mutants bench
.PHONY: adapter driver python
.DEFAULT_GOAL := demo

VENV := target/venv
# Mesa's driver complains where it is unset, as it is in containers.
export XDG_RUNTIME_DIR ?= /tmp
export SPECTROLL_PYTHON := $(abspath $(VENV))/bin/python

# A million reflectances, and a picture of what they are drawn from. Without the formats that cost time to build, which
# `make test` and `cargo install --path .` have.
demo:
	cargo build --locked --release --no-default-features --features cli
	target/release/spectroll sample munsell-vrhel -n 1000000 -o target/reflectances.npy --force
	target/release/spectroll inspect munsell-vrhel -o target/munsell-vrhel.png --force

test: driver python
	cargo test --locked --release --workspace --exclude spectroll-python

# The tests that hold an adapter against the CPU, on a second software Vulkan with a compiler of its own. It draws slowly:
# `make test-swiftshader SWIFTSHADER_TESTS="lists twins"` has the longest of them.
SWIFTSHADER_TESTS ?= quantities cover scene embedding guests
SWIFTSHADER := target/swiftshader/vk_swiftshader_icd.json
test-swiftshader: driver $(SWIFTSHADER)
	VK_DRIVER_FILES=$(abspath $(SWIFTSHADER)) VK_ICD_FILENAMES=$(abspath $(SWIFTSHADER)) cargo test --locked --release \
		$(addprefix --test ,$(SWIFTSHADER_TESTS))

$(SWIFTSHADER): scripts/swiftshader.sh
	@sh scripts/swiftshader.sh $(dir $@)
	@touch $@

# The Python package: its wheel, installed into a fresh environment.
test-python: driver python
	@sh scripts/wheel.sh $(VENV) target/wheel -m 'not slow'

# The page, served on this machine alone: its address is printed. PORT picks the port.
PORT ?= 8000
web: web-build
	python3 web/serve.py target/page $(PORT)

# The page as files, in target/page.
web-build:
	@bash web/build.sh

# The page in a real browser, with WebGPU on a software adapter, against the files that the program writes.
web-test: web-build
	cargo build --locked --release
	@sh web/browser.sh
	cd web/tests && npm ci --silent --no-audit --no-fund && npm test

# A wheel for any Linux with glibc 2.17 or newer, with Zig as its linker; elsewhere, one for this system.
wheel: python
	$(SPECTROLL_PYTHON) -m pip install --quiet 'maturin[zig]>=1.16,<2'
	$(VENV)/bin/maturin build --release --locked --interpreter $(SPECTROLL_PYTHON) --out target/wheels \
		$(if $(filter Linux,$(shell uname -s)),--zig --compatibility manylinux2014)

# Runs the notebook with the wheel that was tested last, and keeps its pictures.
notebook:
	target/wheel/venv/bin/python scripts/notebook.py

# What takes minutes: all 2^32 words through the radius and the circle, the statistics under 200 seeds, and the fit on
# 100,000 matrices and 1,000 small files, a million draws of each kind on devices that take every liberty, a cube of colours,
# and draws on clusters of Dask and Ray.
exhaustive: python
	cargo test --locked --release --lib --test statistics --test fit --test adversary --test metamers -- --ignored --nocapture
	test -d target/wheel/venv || $(MAKE) test-python
	target/wheel/venv/bin/python -m pip install --quiet -r python/tests/requirements-slow.txt
	target/wheel/venv/bin/python -m pytest -q -m slow

# Every system call that a run makes fails once, and from there on; and 200 crowds of processes write one name.
faults:
	cargo test --locked --release --test faults --test crowds -- --ignored --nocapture

# Random bytes for each reader, instrumented on a stable compiler: seconds each, as in `make fuzz SECONDS=900`. What breaks
# one is left in fuzz/artifacts.
SECONDS ?= 60
TARGETS ?= npy h5 mat text npz parquet zarr xlsx envi model scene manifest sidecar recipe config
SANCOV := -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
	-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
	-Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1
HOST := $(shell rustc -vV | sed -n 's/^host: //p')
fuzz:
	cd fuzz && RUSTFLAGS="--cfg fuzzing $(SANCOV)" cargo build --locked --release --target $(HOST) --target-dir ../target/fuzz
	mkdir -p fuzz/artifacts
	for target in $(TARGETS); do mkdir -p target/fuzz/corpus/$$target; \
		target/fuzz/$(HOST)/release/$$target target/fuzz/corpus/$$target fuzz/corpus/$$target \
			-max_total_time=$(SECONDS) -timeout=2 -rss_limit_mb=1024 -max_len=16384 \
			-print_final_stats=1 -artifact_prefix=fuzz/artifacts/$$target- || exit 1; done

# Small changes of the code, of which a test must notice each: a sample of those in a room, as in `make mutants ROOM=cover`.
# Minutes each room; `cargo install cargo-mutants` comes first.
ROOM ?= program
SAMPLE ?= 0/8
mutants: driver python
	cargo mutants --in-place --profile mutants --file 'src/$(ROOM)/**' --file 'src/$(ROOM).rs' --shard $(SAMPLE) \
		--sharding round-robin --no-shuffle --baseline skip --timeout 300 -o target \
		--no-default-features --features cli -- --lib --tests

# In-process and whole-process rates, beside NumPy and Numba.
bench: driver python
	cargo build --locked --release
	$(SPECTROLL_PYTHON) -m pip install --quiet numba
	$(SPECTROLL_PYTHON) scripts/bench.py

# What a new adapter owes, of the number or with the name in ADAPTER: a report, and rows for docs/measurements.md.
ADAPTER ?= 0
adapter: driver
	cargo build --locked --release
	target/release/spectroll report --adapter '$(ADAPTER)' -o target/adapter --force
	@cat target/adapter/adapter.md

# A Vulkan driver: Mesa's software one where there is none.
driver:
	@sh scripts/driver.sh

# NumPy, SciPy and the readers of every format, against which fits and files are tested.
python: $(VENV)/ready

$(VENV)/ready: scripts/python.sh
	@sh scripts/python.sh $(VENV)
	@touch $@
