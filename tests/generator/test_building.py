"""Scenes made in Python are those of the same text."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy

import hamotor
from hamotor.mechanics.language import norm, norm_squared

TEXT = """
algebra = "cga3"
group = "Sim3"
[[body]]
name = "ball"
momentum = { e12 = 0.3, e1i = 0.2, e0i = 0.1 }
[hamiltonian]
expression = "norm_squared(P)/2 + norm_squared(Pi)/0.4 + momentum(ball).e0i^2 + k*(scale - 1)^2 + norm(at(0, 0, 0.1))"
parameters = { k = 3.5 }
[time]
end = 0.5
step = 0.01
"""  # noqa: E501


def test_a_hamiltonian_of_python_objects_moves_as_that_of_the_same_text(tmp_path: Path) -> None:
    ball = hamotor.body("cga3", "Sim3", "ball")
    k = sympy.Symbol("k", real=True)
    energy = (
        norm_squared(ball.P) / 2
        + norm_squared(ball.Pi) / sympy.Rational(2, 5)
        + ball.momentum.e0i**2
        + k * (ball.scale - 1) ** 2
        + norm(ball.at(0, 0, 0.1))
    )
    made = hamotor.from_hamiltonian(
        energy,
        [ball],
        momenta=[{"e12": 0.3, "e1i": 0.2, "e0i": 0.1}],
        parameters={k: 3.5},
        end=0.5,
        step=0.01,
    ).run()
    scene = tmp_path / "scene.toml"
    scene.write_text(TEXT, encoding="utf-8")
    read = hamotor.load(scene).run()
    assert made.final["ball"] == read.final["ball"]
    assert set(made.report["conserved"]) == set(read.report["conserved"])


def test_rates_instead_of_momenta() -> None:
    point = hamotor.body("pga3", "T3", "point")
    run = hamotor.from_hamiltonian(
        norm_squared(point.P) / 4, [point], rates=[{"e01": 1.5}], end=2, step=0.1
    ).run()
    assert run.final["point"]["position"] == pytest.approx([3, 0, 0], abs=1e-14)


def test_mistakes_are_named() -> None:
    ball = hamotor.body("pga3", "SE3", "ball")
    with pytest.raises(AttributeError, match=r'has no "momentun".*Did you mean "momentum"'):
        _ = ball.momentun
    with pytest.raises(hamotor.UsageError, match="Did you mean"):
        hamotor.body("pga3", "SE4")
    energy = norm_squared(ball.P) * sympy.Symbol("k", real=True) + norm_squared(ball.Pi)
    with pytest.raises(hamotor.UsageError, match="no value for k"):
        hamotor.from_hamiltonian(energy, [ball], momenta=[{}], end=1, step=0.1)
    with pytest.raises(hamotor.UsageError, match='unknown component "e32"'):
        hamotor.from_hamiltonian(
            norm_squared(ball.P), [ball], momenta=[{"e32": 1}], end=1, step=0.1
        )
