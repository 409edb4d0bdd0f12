"""Code paths are pinned before numpy starts, without a warning, and never against the user."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest
from numpy._core import _multiarray_umath as simd

from reobserve.core.code_paths import DISABLED, ENABLED, KERNEL, THREADS, unpinned

pytestmark = pytest.mark.skipif(
    platform.machine().lower() not in ("x86_64", "amd64"), reason="nothing is pinned elsewhere"
)

PIN = "from reobserve.core.code_paths import pin_code_paths; pinned = pin_code_paths(); "
LOOK = (
    "from numpy._core import _multiarray_umath as numpy; "
    "print([name for name in numpy.__cpu_dispatch__ if numpy.__cpu_features__[name]]); "
)


def run(code: str, **variables: str) -> list[str]:
    """The output of a new process in which warnings are errors."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=unpinned(dict(os.environ)) | variables, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout.splitlines()


def test_numpy_dispatch_is_disabled_without_warnings() -> None:
    show = f"import os; print(pinned, os.environ['{KERNEL}'], os.environ['{THREADS[0]}'])"
    assert run(PIN + LOOK + show) == ["[]", "True Nehalem 1"]


def test_test_process_uses_the_pinned_code_paths() -> None:
    """No plugin has imported numpy before, unless the environment sets something else."""
    found = [name for name in simd.__cpu_dispatch__ if simd.__cpu_features__[name]]
    assert found == [] or os.environ.get(ENABLED) != " "


def test_user_environment_takes_precedence() -> None:
    show = f"import os; print(pinned, os.environ['{KERNEL}'])"
    assert run(PIN + show, **{KERNEL: "Haswell"}) == ["False Haswell"]
    # numpy refuses to start if features are both enabled and disabled by name.
    everything = run(LOOK)
    some = run("import numpy; print(numpy._core._multiarray_umath.__cpu_dispatch__[0])")[0]
    found = run(PIN + LOOK + "print(pinned)", **{DISABLED: some} if some in everything[0] else {})
    assert found[-1] == str(some not in everything[0])
    assert run(PIN + LOOK + "print(pinned)", **{ENABLED: ""}) == [*everything, "False"]


def test_numpy_imported_too_early_is_reported() -> None:
    assert run(f"import numpy; {PIN} print(pinned)") == ["False"]


def test_importing_the_library_pins_nothing() -> None:
    code = "import os; before = dict(os.environ); import reobserve.observers.imm; "
    assert run(f"{code} print(dict(os.environ) == before)") == ["True"]


def test_matrix_product_uses_the_pinned_kernel() -> None:
    """The product of matrices rounds as by the pinned kernel; each kernel orders its sums
    differently.
    """
    code = (
        "import numpy as np; rng = np.random.default_rng(0); a = rng.standard_normal((40, 40)); "
        "print((a @ a).tobytes().hex()[:4000])"
    )
    pinned = run(PIN + code)
    assert pinned == run(code, **{KERNEL: "Nehalem", ENABLED: " "})
