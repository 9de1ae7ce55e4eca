"""The equations that public solvers are given are the motion of the scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.bench.precision import peers

from hamotor.bench import endpoint, solvers
from hamotor.bench.equations import SMOOTH, Equations, equations
from hamotor.bench.problems import problem
from hamotor.run.simulation import load
from hamotor.scene import Scene
from hamotor.scene.general import GeneralScene, product


def _general(name: str) -> GeneralScene:
    scene = load(name).read()  # type: ignore[misc]
    return scene.general if isinstance(scene, Scene) else scene


def _motion(scene: GeneralScene, state: list[float], t: float) -> list[float]:
    """M B and ad*_B μ − F by the geometric product, and B and F as steppers have them."""
    functions: Any = {"number": float, **{name: getattr(math, name) for name in SMOOTH}}
    known, numbers = {"t": t}, iter(state)
    for k, body in enumerate(scene.bodies):
        group = body.coordinates.group
        known |= {f"m{k}.{c.name}": next(numbers) for c in group.element.components}
        known |= {f"mu{k}.{g.momentum}": next(numbers) for g in group.generators}
    found = scene.system.gradient.evaluate(known, functions)
    rates: list[float] = []
    for k, body in enumerate(scene.bodies):
        group, algebra = body.coordinates.group, body.coordinates.algebra
        b = [found[f"rate{k}.{g.rate}"] for g in group.generators]
        mu = [known[f"mu{k}.{g.momentum}"] for g in group.generators]
        motor: dict[int, float] = {}
        for c in group.element.components:
            for blade, y in c.embedding.items():
                motor[blade] = motor.get(blade, 0.0) + float(y) * known[f"m{k}.{c.name}"]
        rate: dict[int, float] = {}
        for x, g in zip(b, group.generators, strict=True):
            for blade, z in g.bivector.items():
                rate[blade] = rate.get(blade, 0.0) + x * float(z)
        turned = product(algebra, motor, rate)
        rates += [
            sum(float(y) * turned.get(blade, 0.0) for blade, y in reading.items())
            for reading in group.element.reading
        ]
        structure = np.array([[list(map(float, row)) for row in a] for a in group.structure])
        pulled = [found[f"forque{k}.{g.momentum}"] for g in group.generators]
        rates += list(np.einsum("jik,j,k", structure, b, mu) - pulled)
    return rates


@pytest.mark.parametrize("name", ["planar", "manakov", "rocket", "two_bodies"])
def test_equations_are_the_motion_of_motors_and_momenta(name: str) -> None:
    scene = _general(name)
    found = equations(scene)
    assert isinstance(found, Equations)
    assert found.state(found.start) == pytest.approx(list(scene.initial_state), abs=1e-14)
    given = {"kind": "equations", "python": found.python, "end": 1.0, "state": []}
    rates = peers.Problem(given).rates()
    t, h = 0.3, 1e-4
    x: Any = np.array(found.start)
    for _ in range(200):  # away from what a start has of zeros, by midpoints
        x = x + h * np.array(rates(t, list(x + h / 2 * np.array(rates(t, list(x))))))
    along = np.array(rates(t, list(x)))
    ahead, behind = (np.array(found.state(x + e * along)) for e in (h, -h))
    expected = _motion(scene, found.state(x), t)
    assert (ahead - behind) / (2 * h) == pytest.approx(expected, abs=1e-6 * max(map(abs, expected)))
    later = rates(t + 1, list(x))
    assert found.timed == (list(along) != later)


def test_a_rate_that_iterations_find_is_no_equation() -> None:
    assert "Legendre" in str(equations(_implicit()))


def _implicit() -> GeneralScene:
    from dataclasses import replace

    return replace(_general("kepler"), lagrangian=object())  # type: ignore[arg-type]


def test_an_end_that_exploded_is_refused() -> None:
    given = equations(_general("conformal_body"))
    assert isinstance(given, Equations)
    with pytest.raises(OverflowError):
        given.state([1e200] * len(given.start))


@pytest.mark.long
@pytest.mark.parametrize("name", ["rocket", "conformal_top", "two_bodies@2", "free4"])
def test_public_solvers_end_where_the_scene_does(name: str) -> None:
    one = problem(name)
    assert one.generated is not None
    built = one.simulation.compile(method="taylor")
    end = one.simulation.end
    with built.library.start(
        "taylor", step=end, state=one.simulation.state, tolerance=1e-15
    ) as live:
        live.advance(1, 0, None)
        expected = endpoint.of_row(built.description, live.observe())
    gaps: dict[str, str] = {}
    there = solvers.peers_here(gaps)
    contestants: list[dict[str, Any]] = [
        {"kind": "compiled", "settings": [1e-11], "options": {"library": library, "solver": solver}}
        for _, _, library, names in solvers.libraries(("g++",), there, gaps, one.generated.cpp)
        for solver in names
    ]
    if "heyoka" in there:
        contestants.append({"kind": "heyoka", "settings": [1e-12], "options": {"fast_math": False}})
    if "scipy" in there:
        contestants.append({"kind": "scipy", "settings": [1e-12], "options": {"method": "DOP853"}})
    job = {
        "rounds": 0,
        "enough_s": 0.0,
        "problem": one.for_peers,
        "contestants": [{**c, "longest_s": 1e9} for c in contestants],
    }
    for (index, _), row in solvers.timed(job).items():
        found = one.end_of_peer(row["final"], (str(built.build.library), "taylor"))
        scale = max(float(abs(x).max()) for x in expected.values())
        for quantity, error in endpoint.errors(found, expected).items():
            assert error < 1e-6 * scale, (contestants[index]["options"], quantity)
