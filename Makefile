# Each target does its own set-up: what is missing is installed on Debian and Ubuntu, and named elsewhere.
.PHONY: demo test exhaustive bench driver python
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
	cargo test --locked --release

# What takes minutes: all 2^32 words through the radius and the circle, the statistics under 200 seeds, and the fit on
# 100,000 matrices and 1,000 small files.
exhaustive: python
	cargo test --locked --release --lib --test statistics --test fit -- --ignored --nocapture

# In-process and whole-process rates, beside NumPy and Numba.
bench: driver python
	cargo build --locked --release
	$(SPECTROLL_PYTHON) -m pip install --quiet numba
	$(SPECTROLL_PYTHON) scripts/bench.py

# A Vulkan driver: Mesa's software one where there is none.
driver:
	@sh scripts/driver.sh

# NumPy, SciPy and the readers of every format, against which fits and files are tested.
python: $(VENV)/ready

$(VENV)/ready: scripts/python.sh
	@sh scripts/python.sh $(VENV)
	@touch $@
