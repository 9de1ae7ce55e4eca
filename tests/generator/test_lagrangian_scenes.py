"""Scenes that give L: their Legendre transform in formulas, or by Newton's method as they run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import hamotor

START = """
algebra = "pga3"
[[body]]
name = "brick"
position = [0.3, -0.1, 0.4]
velocity = [0.2, -0.6, 0.3]
angular_velocity = [0.8, 0.5, -1.1]
"""
PARAMETERS = "parameters = { m = 1.5, j = [0.4, 0.7, 0.9], g = 0.98 }"
KINETIC = "m/2*norm_squared(V) + (j.x*Omega.x^2 + j.y*Omega.y^2 + j.z*Omega.z^2)/2"
TIME = "[time]\nend = 0.5\nstep = 0.005\n"
DAMPED = '[[interaction]]\ntype = "damping"\nbody = "brick"\nlinear = 0.1\nangular = 0.3\n'


def ran(tmp_path: Path, text: str) -> dict[str, Any]:
    scene = tmp_path / "scene.toml"
    scene.write_text(START + text + TIME, encoding="utf-8")
    report: dict[str, Any] = hamotor.load(scene).run().report
    return report


def test_a_quadratic_lagrangian_moves_as_the_rigid_body_it_describes(tmp_path: Path) -> None:
    lagrangian = ran(
        tmp_path,
        f'[lagrangian]\nexpression = "{KINETIC} - m*g*position.z"\n{PARAMETERS}\n{DAMPED}',
    )
    body = START.replace("position =", "mass = 1.5\ninertia = [0.4, 0.7, 0.9]\nposition =", 1)
    scene = tmp_path / "rigid.toml"
    gravity = '[[interaction]]\ntype = "gravity"\nacceleration = [0, 0, -0.98]\n'
    scene.write_text(body + gravity + DAMPED + TIME, encoding="utf-8")
    rigid = hamotor.load(scene).run().report
    for part in ("motor", "momentum"):
        expected = rigid["final"]["brick"][part]
        assert lagrangian["final"]["brick"][part] == pytest.approx(expected, abs=1e-14)


def test_where_no_formula_inverts_the_momenta_newton_finds_the_rates(tmp_path: Path) -> None:
    coupled = f"{KINETIC} + exp(norm_squared(V)/9 + (Omega.x + V.y/2)^2/7)/3"
    text = f'[lagrangian]\nexpression = "{coupled} - m*g*position.z"\n{PARAMETERS}\n'
    conserved = ran(tmp_path, text)["conserved"]
    assert list(conserved) == ["energy"]
    assert conserved["energy"]["max_relative_error"] < 1e-10
    damped = ran(tmp_path, text + DAMPED)["conserved"]
    assert list(damped) == ["energy_balance"]
    assert damped["energy_balance"]["max_relative_error"] < 1e-10


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        ("m/2*V.x^2", r"does not depend on the rate w23"),
        (f"{KINETIC} - m/2*V.z^2 + V.z", r"singular .* along the rates v3|along v3"),
        (f"{KINETIC} - P.x", r'unknown name "P"'),
        (f"{KINETIC} + momentum(brick).e12", r'unknown function "momentum"'),
    ],
)
def test_a_lagrangian_that_is_none_says_where(
    tmp_path: Path, expression: str, message: str
) -> None:
    with pytest.raises(hamotor.UsageError, match=rf"scene\.toml: \[lagrangian\]: .*{message}"):
        ran(tmp_path, f'[lagrangian]\nexpression = "{expression}"\n{PARAMETERS}\n')
