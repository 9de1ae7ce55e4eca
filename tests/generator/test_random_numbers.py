"""Random numbers of ensembles: the same for a member whoever is drawn with it, on any machine."""

from __future__ import annotations

import math
from pathlib import Path
from statistics import NormalDist

import mpmath
import numpy as np

from hamotor.run.random_numbers import cosine_and_sine, logarithm, normals, uniforms, uniforms_of
from hamotor.run.sampling import starts
from hamotor.scene.draws import BodyDraws, Draw, Ensemble, Turn

ROOT = Path(__file__).resolve().parents[2]


def test_a_members_numbers_do_not_depend_on_the_range_that_is_drawn() -> None:
    whole = uniforms(7, 0, 50, 6)
    assert whole.shape == (50, 6)
    for first, members in ((0, 1), (13, 4), (49, 1)):
        assert (uniforms(7, first, members, 6) == whole[first : first + members]).all()
    assert (uniforms(8, 0, 50, 6) != whole).all()
    assert ((whole > 0) & (whole < 1)).all()


def test_no_number_is_0_or_1() -> None:
    ends = uniforms_of(np.array([0, 2**64 - 1], dtype=np.uint64))
    assert ends.tolist() == [2.0**-54, 1 - 2.0**-53]


def test_the_numbers_of_a_seed_are_pinned() -> None:
    drawn = uniforms(2026, 10**8, 1, 5)[0]
    assert [x.hex() for x in drawn] == PINNED_UNIFORM
    assert [x.hex() for x in normals(drawn)] == PINNED_NORMAL


PINNED_UNIFORM = [
    "0x1.c96a902e87472p-1",
    "0x1.6305798488069p-2",
    "0x1.28d67135db542p-1",
    "0x1.a7ad8a07fc386p-1",
    "0x1.e3a22f5210a36p-3",
]
PINNED_NORMAL = [
    "0x1.3ea8fe7765c9fp+0",
    "-0x1.93b49d2923746p-2",
    "0x1.9c39dff2c0d0ap-3",
    "0x1.e37d5f0fe7151p-1",
    "-0x1.6fff46ad11ef0p-1",
]


def test_normal_numbers_are_the_inverse_of_the_normal_distribution() -> None:
    tails = np.array([2.0**-54, 1e-12, 1e-7, 0.0749, 0.0751, 0.5, 0.9251, 1 - 1e-9, 1 - 2.0**-53])
    uniform = np.concatenate([tails, uniforms(1, 0, 500, 1)[:, 0]])
    found = normals(uniform)
    with mpmath.workdps(40):
        truth = [float(mpmath.sqrt(2) * mpmath.erfinv(2 * mpmath.mpf(x) - 1)) for x in uniform]
    np.testing.assert_allclose(found, truth, rtol=2e-15, atol=1e-17)
    # The same algorithm in the standard library, whose logarithm is another one.
    others = [NormalDist().inv_cdf(x) for x in uniform]
    np.testing.assert_allclose(found, others, rtol=4e-15, atol=1e-17)


def test_elementary_functions_are_good_to_two_units_in_the_last_place() -> None:
    x = np.concatenate([uniforms(2, 0, 2000, 1)[:, 0], np.geomspace(1e-300, 1e300, 1000), [1.0]])
    ln = np.array([math.log(value) for value in x])
    assert (np.abs(logarithm(x) - ln) <= 2 * np.spacing(np.abs(ln))).all()
    angles = np.linspace(-6000, 6000, 3001)
    cosine, sine = cosine_and_sine(angles)
    np.testing.assert_allclose(cosine, [math.cos(a) for a in angles], rtol=0, atol=3e-16)
    np.testing.assert_allclose(sine, [math.sin(a) for a in angles], rtol=0, atol=3e-16)


def test_cpp_draws_the_same_bits() -> None:
    """`hamotor/random_numbers.hpp`: tests/runtime/random_numbers.cpp pins the same hash."""
    rotor = tuple((k, 0, k, 0, 1.0) for k in range(4))
    any_turn = Turn("all", Draw("normal", (0.0,) * 4, (1.0,) * 4))
    turn = Turn("vector", Draw("normal", (0.0,) * 3, (20.0,) * 3))
    ensemble = Ensemble(
        bodies=(
            BodyDraws(
                motor=0,
                momentum=0,
                momenta=(
                    (0, Draw("uniform", (-2.0,), (3.0,))),
                    (1, Draw("normal", (1.0,), (0.5,))),
                ),
            ),
            BodyDraws(motor=2, momentum=0, terms=rotor, turn=any_turn),
            BodyDraws(motor=6, momentum=0, terms=rotor, turn=turn),
        )
    )
    rows = [
        starts(ensemble, np.zeros(10), seed, 125_003 * k**3, 1)[0].ravel()
        for seed in (0, 2026, 2**64 - 1)
        for k in range(200)
    ]
    tails = np.array([2.0**-54, 1e-12, 0.0749, 0.5, 0.9251, 1 - 1e-9, 1 - 2.0**-53])
    hashed = 0xCBF29CE484222325
    for word in np.concatenate([*rows, normals(tails)]).view(np.uint64).tolist():
        hashed = (hashed ^ word) * 0x100000001B3 % 2**64
    text = (ROOT / "tests/runtime/random_numbers.cpp").read_text(encoding="utf-8")
    assert f'EXPECT_EQ(hash.text(), "{hashed:016x}");' in text
