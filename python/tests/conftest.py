"""What the tests share: the program of the same wheel, and engines to draw with."""

import os
import signal
import subprocess
import sys

import pytest

os.environ.setdefault("XDG_RUNTIME_DIR", "/tmp")  # Mesa's driver complains where it is unset
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell has it ignored for what it starts with "&"


@pytest.fixture
def program(tmp_path):
    """Runs `spectroll` with these words in a folder of the test's own, and returns what it prints."""

    def run(*words, code=0):
        words = [str(word) for word in words]
        done = subprocess.run(
            [sys.executable, "-m", "spectroll", *words], cwd=tmp_path, capture_output=True, text=True, timeout=100
        )
        assert done.returncode == code, (words, done.stderr)
        return done.stdout + done.stderr

    return run


@pytest.fixture(params=["cpu", "gpu"])
def engine(request):
    return request.param
