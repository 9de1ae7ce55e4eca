"""A user's own group, in a few lines of TOML, is stepped like a bundled one."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import pytest

import hamotor
from hamotor.codegen.spec import Request
from hamotor.errors import UsageError
from hamotor.scene.algebra import scene_algebra

ROOT = Path(__file__).resolve().parents[2]
JOINTS = """
name = "joints"
description = "a screw, and rigid motions that keep the direction e3"
extends = "pga3"

[[group]]
name = "Screw"
description = "helical joint about e3: 1/3 m of advance in a radian"
element = "Motor"
generators = [{ name = "h", bivector = { e12 = "-1/2", e03 = "-1/6" }, rate = "w", momentum = "l" }]
casimirs = [{ name = "l", numerator = "l" }]

[[group]]
name = "SE2R"
description = "planar motions and translations along e3"
element = "Motor"
generators = [
  { name = "e12", bivector = { e12 = "-1/2" }, rate = "w12", momentum = "l12" },
  { name = "e01", bivector = { e01 = "-1/2" }, rate = "v1", momentum = "p1" },
  { name = "e02", bivector = { e02 = "-1/2" }, rate = "v2", momentum = "p2" },
  { name = "e03", bivector = { e03 = "-1/2" }, rate = "v3", momentum = "p3" },
]
casimirs = [
  { name = "p_squared", formula = "p1² + p2²", numerator = "p1^2 + p2^2" },
  { name = "p3", numerator = "p3" },
]
"""
PROGRAM = r"""
#include <cstdio>
#include "hamotor/joints/joints.hpp"
#include "hamotor/steppers.hpp"

template <class G>
struct Quadratic {
  using Group = G;
  using Scalar = double;
  using Rate = typename G::template Rate<double>;
  using State = hamotor::State<G, 1, double>;
  static constexpr std::size_t bodies = 1;
  static constexpr bool has_forque = false;
  constexpr std::array<Rate, 1> rate(const State& state) const noexcept {
    auto w = state.momenta[0].components();
    for (std::size_t a = 0; a < w.size(); ++a) w[a] /= 1 + 0.5 * static_cast<double>(a);
    return {Rate::from(w)};
  }
  constexpr double energy(const State& state) const noexcept {
    return 0.5 * pairing(state.momenta[0], rate(state)[0]);
  }
};

template <class G>
void run(const typename G::template Momentum<double>& momentum, int steps) {
  hamotor::Rkmk4<Quadratic<G>> method;
  hamotor::State<G, 1, double> state{{G::template Element<double>::identity()}, {momentum}};
  for (int k = 0; k < steps; ++k) method.do_step({}, state, 0, 2.0 / steps);
  const auto point = sandwich(state.motors[0], hamotor::joints::Point<double>{1, 0, 0});
  const auto spatial = Ad_star_inverse(state.motors[0], state.momenta[0]);
  for (double x : point.components()) std::printf("%.17g ", x);
  for (double x : spatial.components()) std::printf("%.17g ", x);
  std::printf("%.17g\n", method.drift().largest);
}

int main() {
  run<hamotor::joints::Screw>({0.7}, 10);
  for (int steps : {10, 20, 2000}) run<hamotor::joints::SE2R>({0.4, 0.9, -0.3, 0.5}, steps);
}
"""


def write(folder: Path, text: str = JOINTS) -> Path:
    path = folder / "joints.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_screw_and_a_planar_group_with_lift_are_stepped(tmp_path: Path) -> None:
    algebra = scene_algebra(write(tmp_path), [Request("sandwich", ("Motor", "Point"), None)])
    assert [g.name for g in algebra.groups] == ["Screw", "SE2R"]
    for file in algebra.headers:
        path = tmp_path / file.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file.text, encoding="utf-8")
    (tmp_path / "main.cpp").write_text(PROGRAM, encoding="utf-8")
    folders = [f"-I{tmp_path}", f"-I{ROOT / 'runtime' / 'include'}"]
    flags = ["-std=c++20", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
    subprocess.run(
        ["g++", *flags, *folders, str(tmp_path / "main.cpp"), "-o", str(tmp_path / "main")],
        check=True,
    )
    shown = subprocess.run([str(tmp_path / "main")], check=True, capture_output=True, text=True)
    screw, coarse, fine, reference = (
        [float(x) for x in line.split()] for line in shown.stdout.splitlines()
    )
    angle = 0.7 * 2.0
    expected = [math.cos(angle), math.sin(angle), angle / 3, 0.7]
    assert screw[:4] == pytest.approx(expected, abs=1e-14)
    assert max(screw[-1], fine[-1]) < 1e-14
    errors = [
        max(abs(x - y) for x, y in zip(row[:7], reference, strict=False)) for row in (coarse, fine)
    ]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.15)
    assert reference[3:7] == pytest.approx([0.4, 0.9, -0.3, 0.5], abs=1e-12)
    assert reference[2] == pytest.approx(0.5 / 2.5 * 2, abs=1e-14)


def test_only_what_stepping_needs_is_generated(tmp_path: Path) -> None:
    headers = {f.path: f.text for f in scene_algebra(write(tmp_path)).headers}
    assert set(headers) == {
        f"hamotor/joints/{name}.hpp"
        for name in (
            "elements",
            "kernels",
            "joints",
            "screw",
            "screw_elements",
            "screw_kernels",
            "se2r",
            "se2r_elements",
            "se2r_kernels",
        )
    }
    assert "struct Motor" in headers["hamotor/joints/elements.hpp"]
    assert "struct Plane" not in headers["hamotor/joints/elements.hpp"]
    assert "sandwich" not in headers["hamotor/joints/kernels.hpp"]


def test_a_bundled_algebra_needs_no_headers() -> None:
    algebra = scene_algebra("cga3")
    assert [g.name for g in algebra.groups] == ["SE3", "Sim3", "SO41"]
    assert algebra.headers == ()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"joints"', '"pga3"', '"name" = "pga3" is taken'),
        ('"joints"', '"scalar"', '"name" = "scalar" is a name that generated code'),
        ('"pga3"', '"pga5"', 'extends: unknown algebra "pga5".*Did you mean'),
        ('extends = "pga3"', 'extends = "pga3"\nbasis = ["e1"]', "basis: is that of pga3, which"),
        ("{ e01 =", "{ e31 =", "SE2R is not closed: the bracket of e12 and e01 has parts along"),
        ('e03 = "-1/6"', 'e13 = "-1/6"', None),
        ('numerator = "p3"', 'numerator = "p1"', "SE2R: p3 is no Casimir"),
        (
            "[[group]]",
            (
                '[element.Part]\nsymbol = "m"\ndoc = "No e23, no e31."\nunit = true\n'
                'blades = ["s", "e12", "e01", "e02", "e03", "e0123"]\n[[group]]\n'
                'name = "Cylinder"\ndescription = "c"\nelement = "Part"\n'
                'generators = [{ name = "a", bivector = { e12 = 1 }, rate = "w", momentum = "l" },'
                '{ name = "b", bivector = { e03 = 1 }, rate = "v", momentum = "p" }]\n[[group]]'
            ),
            None,
        ),
        ('element = "Motor"', 'element = "Rotor"', "Rotor does not hold the group: .* e03"),
    ],
)
def test_a_mistake_is_named(tmp_path: Path, old: str, new: str, message: str | None) -> None:
    path = write(tmp_path, JOINTS.replace(old, new, 1))
    if message is None:
        assert scene_algebra(path).groups
        return
    with pytest.raises(UsageError, match=rf"(?s)^joints\.toml: .*{message}"):
        scene_algebra(path)


def test_an_algebra_without_groups_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, JOINTS.split("[[group]]", maxsplit=1)[0])
    with pytest.raises(UsageError, match="has no group, so that nothing can move"):
        scene_algebra(path)


def test_a_scene_lives_on_a_group_of_its_own(tmp_path: Path) -> None:
    """A shaft that spins freely and slides on a spring."""
    (tmp_path / "axial.toml").write_text(
        'name = "axial"\nextends = "pga3"\ndescription = "about and along one axis"\n'
        '[[group]]\nname = "Cylinder"\ndescription = "turning about and sliding along e3"\n'
        'element = "Motor"\ngenerators = [\n'
        '  { name = "e12", bivector = { e12 = "-1/2" }, rate = "w12", momentum = "l12" },\n'
        '  { name = "e03", bivector = { e03 = "-1/2" }, rate = "v3", momentum = "p3" },\n]\n',
        encoding="utf-8",
    )
    scene = tmp_path / "shaft.toml"
    scene.write_text(
        'algebra = "axial.toml"\n[[body]]\nname = "shaft"\nmass = 2\n'
        "inertia = [1, 1, 0.5]\nposition = [0, 0, 1]\nrate = { e12 = 3 }\n"
        '[[interaction]]\ntype = "potential"\nexpression = "k/2*position.z^2"\n'
        "parameters = { k = 8 }\n[time]\nend = 1\nstep = 0.001\n",
        encoding="utf-8",
    )
    run = hamotor.load(scene).run(method="splitting6")
    last = run.report["final"]["shaft"]
    assert last["position"] == pytest.approx([0, 0, math.cos(2)], abs=1e-11)
    assert last["rotation"][0] == pytest.approx([math.cos(3), -math.sin(3), 0], abs=1e-11)
    assert "spatial_momentum.e12" in run.report["conserved"]
