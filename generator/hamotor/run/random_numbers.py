"""Random numbers of an ensemble: member i's are the same whoever else is drawn with it.

A counter-based generator, Philox4x64-10 (Salmon, Moraes, Dror & Shaw, SC 2011), gives member i the
numbers at counters i·n … (i + 1)·n − 1, n blocks of four for each member, so that any range of
members is drawn at once.  What is made of them uses additions, multiplications, divisions and
square roots only, which IEEE 754 rounds alike everywhere: the same bits on every machine, where
NumPy's own logarithms and sines differ from one processor to the next.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_SEEDS = 1 << 64
_WORDS_PER_BLOCK = 4


def uniforms(seed: int, first: int, members: int, each: int) -> Array:
    """Numbers uniform in (0, 1), `each` for every member from `first`: shape (members, each).

    0 ≤ seed < 2⁶⁴, 0 ≤ first.
    """
    blocks = -(-each // _WORDS_PER_BLOCK)
    generator = np.random.Philox(key=seed, counter=first * blocks)
    words = generator.random_raw(members * blocks * _WORDS_PER_BLOCK)
    kept = words.reshape(members, blocks * _WORDS_PER_BLOCK)[:, :each]
    return uniforms_of(kept)


def uniforms_of(words: NDArray[np.uint64]) -> Array:
    """The number in (0, 1) of each word: the middle of one of 2⁵³ parts, rounded."""
    found: Array = ((words >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53
    return np.minimum(found, 1.0 - 2.0**-53, out=found)


# Wichura, Algorithm AS 241 (PPND16), Applied Statistics 37 (1988) 477: numerators and denominators,
# highest power first.
_CENTRE = (
    (
        2.5090809287301226727e3, 3.3430575583588128105e4, 6.7265770927008700853e4,
        4.5921953931549871457e4, 1.3731693765509461125e4, 1.9715909503065514427e3,
        1.3314166789178437745e2, 3.3871328727963666080e0,
    ),
    (
        5.2264952788528545610e3, 2.8729085735721942674e4, 3.9307895800092710610e4,
        2.1213794301586595867e4, 5.3941960214247511077e3, 6.8718700749205790830e2,
        4.2313330701600911252e1, 1.0,
    ),
)  # fmt: skip
_NEAR = (
    (
        7.74545014278341407640e-4, 2.27238449892691845833e-2, 2.41780725177450611770e-1,
        1.27045825245236838258e0, 3.64784832476320460504e0, 5.76949722146069140550e0,
        4.63033784615654529590e0, 1.42343711074968357734e0,
    ),
    (
        1.05075007164441684324e-9, 5.47593808499534494600e-4, 1.51986665636164571966e-2,
        1.48103976427480074590e-1, 6.89767334985100004550e-1, 1.67638483018380384940e0,
        2.05319162663775882187e0, 1.0,
    ),
)  # fmt: skip
_FAR = (
    (
        2.01033439929228813265e-7, 2.71155556874348757815e-5, 1.24266094738807843860e-3,
        2.65321895265761230930e-2, 2.96560571828504891230e-1, 1.78482653991729133580e0,
        5.46378491116411436990e0, 6.65790464350110377720e0,
    ),
    (
        2.04426310338993978564e-15, 1.42151175831644588870e-7, 1.84631831751005468180e-5,
        7.86869131145613259100e-4, 1.48753612908506148525e-2, 1.36929880922735805310e-1,
        5.99832206555887937690e-1, 1.0,
    ),
)  # fmt: skip


def normals(uniform: Array) -> Array:
    """Standard normal numbers, one for each uniform one: the inverse of the normal distribution.

    Relative error some 1e-15 (AS 241).
    """
    q = uniform - 0.5
    found = q * _ratio(_CENTRE, 0.180625 - q * q)
    outside = np.abs(q) > 0.425
    p, q = uniform[outside], q[outside]
    r = np.sqrt(-logarithm(np.where(q < 0, p, 1.0 - p)))
    z = _ratio(_NEAR, r - 1.6)
    far = r > 5.0
    z[far] = _ratio(_FAR, r[far] - 5.0)
    found[outside] = np.where(q < 0, -z, z)
    return found


def _ratio(of: tuple[tuple[float, ...], tuple[float, ...]], x: Array) -> Array:
    found: Array = _polynomial(of[0], x)
    found /= _polynomial(of[1], x)
    return found


def _polynomial(coefficients: tuple[float, ...], x: Array) -> Array:
    found = np.full_like(x, coefficients[0])
    for c in coefficients[1:]:
        found *= x
        found += c
    return found


_LN2_HIGH, _LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10
"""ln 2 in two doubles; the first has 21 trailing zeros, so that its multiples are exact."""
_ATANH = tuple(1.0 / (2 * k + 1) for k in range(11, -1, -1))


def logarithm(x: Array) -> Array:
    """ln x of positive numbers to two units in the last place: 2 artanh of (m − 1)/(m + 1)."""
    mantissa, exponent = np.frexp(x)
    small = mantissa < np.sqrt(0.5)
    mantissa = np.where(small, 2.0 * mantissa, mantissa)
    power = (exponent - small).astype(np.float64)
    s = (mantissa - 1.0) / (mantissa + 1.0)
    found: Array = power * _LN2_HIGH + (2.0 * s * _polynomial(_ATANH, s * s) + power * _LN2_LOW)
    return found


_HALF_PI = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
"""π/2 in three parts, the first two with 20 trailing zeros and more."""
_SINE = tuple((-1) ** k / factorial(2 * k + 1) for k in range(8, -1, -1))
_COSINE = tuple((-1) ** k / factorial(2 * k) for k in range(9, -1, -1))


def cosine_and_sine(angle: Array) -> tuple[Array, Array]:
    """Of angles up to a thousand turns, rad; to two units in the last place of the larger one."""
    quadrant = np.rint(angle * (2.0 / np.pi))
    r = ((angle - quadrant * _HALF_PI[0]) - quadrant * _HALF_PI[1]) - quadrant * _HALF_PI[2]
    cosine, sine = _polynomial(_COSINE, r * r), r * _polynomial(_SINE, r * r)
    turned = np.mod(quadrant, 4.0)
    odd = (turned == 1.0) | (turned == 3.0)
    c, s = np.where(odd, sine, cosine), np.where(odd, cosine, sine)
    c = np.where((turned == 1.0) | (turned == 2.0), -c, c)
    return c, np.where(turned >= 2.0, -s, s)
