"""Generated kernels give the same bits from g++ and clang++, at every level, scalar and in lanes.

exp and log call sin, cos and atan2, whose last bit is the C library's: they are not hashed.
"""

from __future__ import annotations

import shutil

import pytest
from tests.bits.kernel_hashes import (
    COMPILERS,
    EVALUATIONS,
    LEVELS,
    UPDATE,
    Build,
    column,
    hashed_kernels,
    outputs,
    pinned,
    processor_can,
    reports,
    title,
)

from hamotor.codegen import bundled_algebras

ALGEBRAS = bundled_algebras()


FORMS = {
    "fma": (True, [(c, level) for c in COMPILERS for level in LEVELS]),
    "two roundings": (False, [("g++", "-O1"), ("clang++", "-O0")]),
    "two roundings, all": (False, [(c, level) for c in COMPILERS for level in LEVELS]),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fused", "compiled"),
    [
        pytest.param(*form, id=name, marks=pytest.mark.long if "all" in name else ())
        for name, form in FORMS.items()
    ],
)
@pytest.mark.parametrize("algebra", ALGEBRAS)
def test_every_compiler_and_level_gives_the_pinned_bits(
    algebra: str, fused: bool, compiled: list[tuple[str, str]]
) -> None:
    if not processor_can(fused):
        pytest.skip(f"this processor runs only code {'without' if fused else 'with'} hardware fma")
    if missing := [name for name in COMPILERS if shutil.which(name) is None]:
        pytest.skip(f"not installed: {', '.join(missing)}")
    builds = [Build(algebra, *how, fused) for how in compiled]
    pins = pinned()
    wrong = [
        f"{build}, {scalar}{where}: {algebra} {kernel}"
        for build, report in reports(builds).items()
        for (kernel, scalar), hashes in report.items()
        for where, value in (("", hashes.single), (" in a loop", hashes.lanes))
        if value != pins.get(f"{algebra} {kernel}", {}).get(column(scalar, fused))
    ]
    assert not wrong, "\n".join([*wrong[:20], f"meant to change?  {UPDATE}"])


def test_the_pinned_file_lists_the_kernels_that_are_generated() -> None:
    kernels = {f"{algebra} {title(k)}" for algebra in ALGEBRAS for k in hashed_kernels(algebra)}
    assert pinned().keys() == kernels, UPDATE


def test_more_than_a_million_outputs_are_hashed() -> None:
    per_evaluation = sum(outputs(k) for algebra in ALGEBRAS for k in hashed_kernels(algebra))
    assert per_evaluation * EVALUATIONS > 1_000_000
