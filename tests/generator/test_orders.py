"""Every explicit and implicit method has its order on every kind of group, free and forced."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from hamotor.run.build import default_cache, default_includes, find_compiler

SOURCE = Path(__file__).parents[1] / "orders" / "orders.cpp"


@pytest.mark.long
@pytest.mark.parametrize(
    ("header", "group", "length"),
    [
        ("pga3/se3.hpp", "pga3::SE3", "0.5"),
        ("pga2/se2.hpp", "pga2::SE2", "1.5"),
        ("pga4/se4.hpp", "pga4::SE4", "2.5"),
        ("cga3/sim3.hpp", "cga3::Sim3", "0.5"),
        ("cga3/so41.hpp", "cga3::SO41", "0.5"),
    ],
)
def test_observed_orders_are_within_a_tenth_of_the_nominal(
    header: str, group: str, length: str, tmp_path: Path
) -> None:
    program = tmp_path / "orders"
    includes = [f"-I{folder}" for folder in default_includes()]
    subprocess.run(
        [
            *find_compiler(default_cache()).command,
            *("-std=c++20", "-O1", "-ffp-contract=off", *includes),
            *(f'-DHEADER="hamotor/{header}"', f"-DGROUP=hamotor::{group}", f"-DLENGTH={length}"),
            *(str(SOURCE), "-o", str(program)),
        ],
        check=True,
    )
    lines = subprocess.run([program], check=True, capture_output=True, text=True).stdout.split("\n")
    found = [line.split() for line in lines if line]
    assert len(found) == 16
    for method, nominal, observed in found:
        assert float(observed) == pytest.approx(int(nominal), abs=0.1), (group, method)
