"""Equations of motion as text and as LaTeX: what they say is what is computed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import sympy
from tests.generator.test_lagrangian import body_on

from hamotor.errors import UsageError
from hamotor.mechanics.coordinates import Coordinates
from hamotor.mechanics.equations import _forques, _Names, equations
from hamotor.mechanics.hamiltonian import Hamiltonian, coadjoint
from hamotor.mechanics.naming import Generators
from hamotor.scene import read_scene

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
M, K, J = sympy.symbols("m k J1", real=True)
VALUES = {M: sympy.Rational(3, 2), K: sympy.Integer(5), J: sympy.Rational(1, 3)}


def example(algebra: str, group: str, *, motor: bool = False) -> Hamiltonian:
    """Springs, a weight, a direction, damping; with parameters as symbols."""
    body = body_on(algebra, group)
    y = body.at(tuple(sympy.Rational(k + 1, 8) for k in range(body.dimension)))
    energy = sum(p**2 / (2 * M * (k + 1)) for k, p in enumerate(body.momenta))
    energy += body.momenta[0] * body.momenta[-1] / (7 * J)
    energy += K * (sympy.sqrt(sum(x**2 for x in y)) - sympy.Rational(1, 4)) ** 2 / 2
    if body.space.translates:
        energy += M * body.position[1]
    if body.space.affine:
        energy += body.rotation[0][0] * sympy.exp(-(body.rotation[1][0] ** 2)) * body.scale**2
    if motor:
        energy += body.motor[0] ** 3
    damping = tuple(p / 9 for p in body.momenta)
    return Hamiltonian((body,), energy, VALUES, (damping,))


@pytest.mark.parametrize("form", ["ga", "classical"])
@pytest.mark.parametrize("name", ["heavy_top", "spring_pendulum"])
def test_bundled_scenes_print_what_they_printed(name: str, form: Any) -> None:
    found = equations(read_scene(name).hamiltonian, form)
    kept = GOLDEN / f"{name}_{form}.txt"
    assert found == kept.read_text(encoding="utf-8"), f"if it is meant, write it to {kept}"


AFFINE = [
    ("pga3", "SE3"),
    ("cl3", "SO3"),
    ("pga2", "SE2"),
    ("cga3", "Sim3"),
    ("cga2", "Sim2"),
    ("pga3", "T3"),
]


def cross(a: Any, b: Any) -> list[Any]:
    if len(a) == 2:
        return [a[0] * b[1] - a[1] * b[0]]
    return [a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3] for k in range(3)]


def across(p: Any, omega: Any) -> list[Any]:
    """P × Ω, in the plane with Ω normal to it."""
    return cross(p, omega) if len(p) == 3 else [p[1] * omega[0], -p[0] * omega[0]]


@pytest.mark.parametrize(("algebra", "group"), AFFINE)
def test_printed_vector_equations_are_the_coadjoint_action(algebra: str, group: str) -> None:
    body = body_on(algebra, group)
    parts = Generators.of(body)
    angular, omega = ([x[i] for i in parts.turning] for x in (body.momenta, body.rates))
    p, v = ([x[i] for i in parts.moving] for x in (body.momenta, body.rates))
    growing = [i for i, kind in enumerate(parts.kinds) if kind == "dilation"]
    found = coadjoint(body, body.rates)
    d = body.rates[growing[0]] if growing else 0
    wanted: dict[int, Any] = dict.fromkeys(range(len(found)), 0)
    if angular:
        turning = cross(angular, omega) if len(angular) == 3 else [0]
        for k, i in enumerate(parts.turning):
            wanted[i] += turning[k] + (cross(p, v)[k] if p else 0)
    for k, i in enumerate(parts.moving):
        wanted[i] += (across(p, omega)[k] if angular else 0) + d * p[k]
    for i in growing:
        wanted[i] -= sum(a * b for a, b in zip(p, v, strict=True))
    assert all(sympy.expand(x - wanted[i]) == 0 for i, x in enumerate(found))
    law = equations(Hamiltonian((body,), sum(p**2 for p in body.momenta)), "classical")
    assert ("+ P × V" in law) == bool(p and angular and len(angular) == 3)
    assert ("+ d P" in law) == ("dq/dt" in law) == bool(growing)


@pytest.mark.parametrize("form", ["ga", "classical"])
def test_latex_is_balanced(form: Any) -> None:
    text = equations(example("pga2", "SE2"), form, "latex")
    assert text.isascii()
    assert text.count(r"\begin{align*}") == text.count(r"\end{align*}") > 3
    for block in re.findall(r"\\begin{align\*}(.*?)\\end{align\*}", text, re.DOTALL):
        for row in block.strip().split("\\\\\n"):
            assert row.count("&") == 1
            bare = re.sub(r"\\[{}]", "", row)
            depth = 0
            for character in bare:
                depth += {"{": 1, "}": -1}.get(character, 0)
                assert depth >= 0
            assert depth == 0
            assert row.count(r"\left") == row.count(r"\right")


def test_mathematics_of_a_scene_is_set_by_matplotlib() -> None:
    from matplotlib.mathtext import MathTextParser

    text = equations(read_scene("spring_pendulum").hamiltonian, "classical", "latex")
    parser = MathTextParser("path")
    rows = re.findall(r"^  (.*?)(?: \\\\)?$", text, re.MULTILINE)
    assert len(rows) > 30
    for row in rows:
        parser.parse(f"${row.replace('&', '').replace(chr(92) + 'mathsf', '').strip()}$")


def test_bodies_are_told_apart() -> None:
    bodies = tuple(
        Coordinates(name, body.algebra, body.group, f"{name}.")
        for body in [body_on("pga3", "SE3")]
        for name in ("one", "two")
    )
    energy = sum(p**2 for body in bodies for p in body.momenta)
    energy += sum((a - b) ** 2 for a, b in zip(*(b.position for b in bodies), strict=True))
    text = equations(Hamiltonian(bodies, energy), "classical")
    assert "d(one.P₁)/dt" in text
    assert "∂H/∂two.x₃" in text
    assert "Momenta of two" in text


@pytest.mark.parametrize(
    ("algebra", "group", "motor", "message"),
    [
        ("cga3", "SO41", False, "SO41 has no classical form"),
        ("pga4", "SE4", False, "SE4 has no classical form"),
        ("pga3", "SE3", True, "the motor's components"),
    ],
)
def test_classical_form_is_refused_where_there_is_none(
    algebra: str, group: str, motor: bool, message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        equations(example(algebra, group, motor=motor), "classical")


def test_unknown_forms_and_styles_are_refused() -> None:
    hamiltonian = example("pga2", "SE2")
    with pytest.raises(UsageError, match=r'unknown form "clasical".*classical'):
        equations(hamiltonian, "clasical")
    with pytest.raises(UsageError, match='unknown style "tex"'):
        equations(hamiltonian, style="tex")


@pytest.mark.parametrize(("algebra", "group"), AFFINE)
def test_printed_forques_are_those_of_the_hamiltonian(algebra: str, group: str) -> None:
    hamiltonian = example(algebra, group)
    (body,) = hamiltonian.bodies
    names = _Names(hamiltonian, classical=False)
    gradients, forques = _forques(hamiltonian, 0, names)
    back = {symbol: root for root, symbol in names.lengths.items()}
    symbols = {name.text: symbol for symbol, name in names.of_symbols.items()}
    put_in = {symbols[e.left.text]: e.right[0] for e in gradients}
    known = {x: sympy.Rational(k + 2, 11) for k, x in enumerate(_symbols_of(hamiltonian))}
    for printed, wanted in zip(forques, hamiltonian.all_forques[0], strict=True):
        whole = printed.subs(put_in).subs(back).subs(known)
        assert abs(sympy.N(whole - wanted.subs(known), 40)) < 1e-30
    assert gradients
    assert len(forques) == len(body.rates)


def _symbols_of(hamiltonian: Hamiltonian) -> list[Any]:
    held = {x for forque in hamiltonian.all_forques for f in forque for x in f.free_symbols}
    return sorted(held | set(VALUES), key=lambda x: str(x.name))
