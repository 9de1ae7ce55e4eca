"""How tests are run."""

from __future__ import annotations

import os

import pytest


def pytest_configure(config: pytest.Config) -> None:
    """Scenes are compiled in half the time, unless tests that run for long are to be run.

    What they calculate does not depend on it: the kernels fuse where they say so.
    """
    if "not long" in config.option.markexpr:
        os.environ.setdefault("HAMOTOR_CXXFLAGS", "-O1")
