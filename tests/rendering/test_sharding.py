"""Rays on four simulated devices: the same dream as on one, but for rounding."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

from dreamfields_core.rendering.sharding import device_mesh
from dreamfields_core.rendering.shares import Share, uniform

REPO = Path(__file__).resolve().parent.parent.parent


@pytest.mark.slow
def test_four_devices_dream_what_one_does() -> None:
    flags = os.environ.get("XLA_FLAGS", "") + " --xla_force_host_platform_device_count=4"
    environment = os.environ | {"XLA_FLAGS": flags, "PYTHONPATH": str(REPO), "JAX_PLATFORMS": "cpu"}
    command = [sys.executable, "-m", "tests.rendering.four_devices"]
    done = subprocess.run(command, cwd=REPO, env=environment, capture_output=True, text=True, timeout=280, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    said = json.loads(done.stdout.splitlines()[-1])
    one, four = said["one"], said["four"]
    assert [dream["mesh"] for dream in (one, four)] == [1, 4]
    # Compiled once: a resumed state comes from the host, and must not bring another program with it.
    assert [dream["compiled"] for dream in (one, four)] == [1, 1]
    for step, (row, other) in enumerate(zip(one["rows"], four["rows"], strict=True)):
        # The same rays, samples and random numbers; sums in another order, whose rounding grows with every step of Adam.
        for name, value in (row | {"evaluated": other["evaluated"]}).items():
            assert other[name] == pytest.approx(value, rel=1e-5, abs=2e-6 * (step + 1)), (step, name)
        assert other["evaluated"] == pytest.approx(row["evaluated"], abs=2e-3)  # a sample on the edge of a cell
    for name, moved in one["moved"].items():
        length = np.linalg.norm(moved)
        assert np.linalg.norm(np.array(four["moved"][name]) - moved) <= 1e-4 * length + 1e-6, name
    assert said["refusals"] == [
        "expected render.devices to divide the 128 rays of a step, got 3: change it, or render.size",
        "expected at most 4 for render.devices, the number of devices here, got 8",
    ]


def test_a_ray_has_the_same_numbers_whoever_renders_it() -> None:
    key, rays, samples, of = jax.random.key(3), 12, 5, 4
    whole = np.asarray(uniform(key, (rays, samples), None))
    np.testing.assert_array_equal(whole, jax.random.uniform(key, (rays, samples)))
    for first in range(of):
        own = uniform(key, (rays // of, samples), Share(first=jax.numpy.int32(first), of=of, axis="rays"))
        np.testing.assert_array_equal(own, whole[first::of])


def test_one_device_makes_no_mesh() -> None:
    assert len(jax.local_devices()) == 1
    assert device_mesh(None, rays=128) is None and device_mesh(1, rays=7) is None
    with pytest.raises(ValueError, match=r"expected at most 1 for render.devices, the number of devices here, got 2"):
        device_mesh(2, rays=128)
