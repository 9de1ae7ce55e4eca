"""From a Lagrangian to a Hamiltonian and back: the Legendre transform on a Lie algebra.

L(M, B, t) gives μ = ∂L/∂B, H = μ·B − L at that B, and F_b = +dH at fixed μ = −dL at fixed B. In
formulas where it closes: rates that L does not couple are transformed by themselves; what is
quadratic in them by an exact inverse, and c + b·B + g(√(BᵀKB)) by solving n = g'(w) for w. Every
formula is held against ∂L/∂B at random states before it is used.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import mpmath
import numpy as np
import sympy

from hamotor.errors import UsageError
from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.evaluation import (
    DIGITS,
    Numbers,
    Values,
    evaluated,
    is_real,
    number,
    place,
    random_motor,
    solved,
    values_of,
)
from hamotor.mechanics.hamiltonian import TIME, Hamiltonian

MOST_OPERATIONS = 400
"""Of a transformed block that is kept as a formula."""
MOST_SOLVED = 60
"""Operations of an equation that SymPy is asked to solve."""
LONGEST_COEFFICIENT = 12
"""Operations of what stands before rates and is not abbreviated while solving for them."""
MOST_INVERTED = 150
"""Of a matrix of which an inverse in symbols is tried."""
LARGEST_DENSE_SYMBOLIC = 3
"""Blocks of up to so many rates are inverted with symbols in them; larger ones with numbers."""
SINGULAR = 1e-11
"""Smallest ratio of eigenvalues of a Hessian, its diagonal scaled to 1, that counts as regular."""
_SIZES = (0.0, 1.0, 0.01, 0.1, 0.3, 3.0, 10.0, 100.0)
_DIGITS = 40


class NotHyperregular(UsageError):
    """B ↦ ∂L/∂B has no inverse; the message says where, and along which rates."""


@dataclass(frozen=True)
class Lagrangian:
    """L over rates, places, points and parameters of one or several bodies on one group, J.

    applied: as in `Hamiltonian`, in rates instead of momenta.
    NotHyperregular where L does not know a combination of rates at all.
    """

    bodies: tuple[Coordinates, ...]
    function: Expr
    parameters: Mapping[Expr, Expr] = field(default_factory=dict)
    applied: tuple[tuple[Expr, ...], ...] = ()

    @staticmethod
    def of(hamiltonian: Hamiltonian) -> Lagrangian | None:
        """The Lagrangian of a Hamiltonian; None where the transform does not close in formulas."""
        bodies = hamiltonian.bodies
        rates = [x for body in bodies for x in body.rates]
        momenta = [x for body in bodies for x in body.momenta]
        energy = on_the_group(hamiltonian.energy, bodies, momenta)
        parameters = hamiltonian.parameters
        samples = _samples(bodies, momenta, energy, parameters)
        function = legendre_transform(energy, momenta, rates, parameters, samples)
        if function is None:
            return None
        back = {p: sympy.diff(function, rate) for p, rate in zip(momenta, rates, strict=True)}
        applied = tuple(tuple(x.subs(back) for x in forque) for forque in hamiltonian.applied)
        return Lagrangian(bodies, function, parameters, applied)

    @cached_property
    def rates(self) -> list[Expr]:
        """B of all bodies in a row."""
        return [rate for body in self.bodies for rate in body.rates]

    @cached_property
    def momenta(self) -> list[Expr]:
        """∂L/∂B, in the order of `rates`."""
        return [sympy.diff(self.function, rate) for rate in self.rates]

    @cached_property
    def hessian(self) -> list[list[Expr]]:
        """∂²L/∂B², rows and columns in the order of `rates`."""
        size = range(len(self.rates))
        rows = [[sympy.Integer(0) for _ in size] for _ in size]
        for i in size:
            for j in range(i + 1):
                rows[i][j] = rows[j][i] = sympy.diff(self.momenta[i], self.rates[j])
        return rows

    @property
    def at_fixed_rates(self) -> Hamiltonian:
        """−L as if it were H: its forques are those of L."""
        return Hamiltonian(self.bodies, -self.function, self.parameters, self.applied)

    @cached_property
    def hamiltonian(self) -> Hamiltonian | None:
        """H = μ·B − L in momenta; None where the transform does not close in formulas."""
        momenta = [p for body in self.bodies for p in body.momenta]
        function = on_the_group(self.function, self.bodies, self.rates)
        energy = legendre_transform(function, self.rates, momenta, self.parameters, self._sampled)
        if energy is None:
            return None
        slopes = {rate: sympy.diff(energy, p) for rate, p in zip(self.rates, momenta, strict=True)}
        applied = tuple(tuple(x.subs(slopes) for x in forque) for forque in self.applied)
        return Hamiltonian(self.bodies, energy, self.parameters, applied)

    @cached_property
    def _sampled(self) -> list[Values]:
        return _samples(self.bodies, self.rates, self.function, self.parameters)

    def momentum_of_rates(
        self, motors: Sequence[Numbers], rates: Sequence[Numbers], time: float = 0
    ) -> tuple[tuple[Any, ...], ...]:
        """μ = ∂L/∂B of each body, where its motor and its rates have these components."""
        with mpmath.workdps(DIGITS):
            known = self._state(motors, rates, time)
            numbers = iter(evaluated(self.momenta, known))
            return tuple(tuple(next(numbers) for _ in body.rates) for body in self.bodies)

    def rates_of_momentum(
        self, motors: Sequence[Numbers], momenta: Sequence[Numbers], time: float = 0
    ) -> list[Any] | None:
        """B of all bodies in a row, where ∂L/∂B are these momenta, in mpmath's precision.

        None where Newton's method, from rest, finds none.
        """
        wanted = [mpmath.mpf(x) for body_momenta in momenta for x in body_momenta]
        size = len(wanted)
        known = self._state(motors, [(0,) * len(body.rates) for body in self.bodies], time)
        hessian = [x for row in self.hessian for x in row]

        def residual(rates: Numbers) -> list[Any]:
            values = known | dict(zip(self.rates, rates, strict=True))
            return [a - b for a, b in zip(evaluated(self.momenta, values), wanted, strict=True)]

        def jacobian(rates: Numbers) -> Any:
            values = known | dict(zip(self.rates, rates, strict=True))
            flat = evaluated(hessian, values)
            return mpmath.matrix([flat[i : i + size] for i in range(0, size * size, size)])

        return solved(residual, jacobian, [mpmath.mpf(0)] * size)

    def _state(self, motors: Sequence[Numbers], rates: Sequence[Numbers], time: float) -> Values:
        known = values_of(self.parameters, time)
        for body, motor, body_rates in zip(self.bodies, motors, rates, strict=True):
            known = place(body, motor, known)
            known |= dict(zip(body.rates, map(number, body_rates), strict=True))
        return known

    def require_hyperregular(
        self, motors: Sequence[Numbers] | None = None, rates: Sequence[Numbers] | None = None
    ) -> None:
        """Refuse an L whose momenta do not determine its rates.

        Looked for in symbols (a rate that L does not hold), at rest and at random states, and at
        the state of these motors and rates. The Hessian must be regular and of one signature; it
        need not be positive, since groups with boosts have indefinite kinetic energies.
        NotHyperregular says where and along which rates.
        """
        for rate in self.rates:
            if rate not in self.function.free_symbols:
                raise NotHyperregular(
                    f"L does not depend on the rate {rate}, so that no momentum belongs to it; "
                    "add its kinetic energy, or take a group without it"
                )
        with mpmath.workdps(_DIGITS):
            states = [("at a random state", values) for values in self._sampled]
            if motors is not None and rates is not None:
                states.insert(0, ("at the initial state", self._state(motors, rates, 0)))
            self._require_one_signature(states)

    def _require_one_signature(self, states: Sequence[tuple[str, Values]]) -> None:
        size = len(self.rates)
        flat = [x for row in self.hessian for x in row]
        first: tuple[int, str] | None = None
        singular: list[tuple[str, str]] = []
        regular = 0
        for where, values in states:
            numbers = evaluated(flat, values)
            shown = self._shown(where, values)
            if not is_real(numbers):
                if where == "at the initial state":
                    raise NotHyperregular(f"∂²L/∂B² is no number {shown}")
                continue
            if not all(map(mpmath.isfinite, numbers)):
                continue
            # Scaled before it is rounded to double, which a growing L would overflow.
            diagonal = [abs(numbers[k * (size + 1)]) or mpmath.mpf(1) for k in range(size)]
            scale = [1 / mpmath.sqrt(x) for x in diagonal]
            scaled = [float(x * scale[k // size] * scale[k % size]) for k, x in enumerate(numbers)]
            matrix = np.array(scaled).reshape(size, size)
            eigenvalues, vectors = np.linalg.eigh(matrix)
            smallest = int(np.argmin(np.abs(eigenvalues)))
            if np.abs(eigenvalues[smallest]) <= SINGULAR * np.abs(eigenvalues).max():
                singular.append(
                    (shown, self._direction(vectors[:, smallest] * np.array(scale, dtype=float)))
                )
                continue
            regular += 1
            negative = int((eigenvalues < 0).sum())
            if first is None:
                first = negative, shown
            elif negative != first[0]:
                raise NotHyperregular(
                    f"∂²L/∂B² has {first[0]} negative eigenvalues {first[1]} but {negative} "
                    f"{shown}: between these states it is singular, and momenta do not determine "
                    "rates"
                )
        if singular and not regular:
            raise NotHyperregular(
                f"∂²L/∂B² is singular wherever it was tried: L is at most linear along the rates "
                f"{singular[0][1]}, and momenta do not determine them"
            )
        if singular:
            shown, direction = singular[0]
            raise NotHyperregular(
                f"∂²L/∂B² is singular {shown}: momenta do not determine the rates along {direction}"
            )

    def _shown(self, where: str, values: Values) -> str:
        if not any(values[rate] for rate in self.rates):
            return f"{where}, at rest" if "initial" in where else "at rest"
        listed = ", ".join(f"{rate} = {float(values[rate]):.3g}" for rate in self.rates)
        return f"{where} ({listed})"

    def _direction(self, vector: Any) -> str:
        """`w12 − 2 v1`."""
        vector = vector / vector[np.argmax(np.abs(vector))]
        text = ""
        for rate, x in zip(self.rates, vector, strict=True):
            if abs(x) < 1e-6:
                continue
            size = "" if abs(abs(x) - 1) < 1e-6 else f"{abs(x):.3g} "
            sign = ("−" if x < 0 else "") if not text else (" − " if x < 0 else " + ")
            text += f"{sign}{size}{rate}"
        return text


def _samples(
    bodies: Sequence[Coordinates],
    velocities: Sequence[Expr],
    function: Expr,
    parameters: Mapping[Expr, Expr],
) -> list[Values]:
    """States at random places, at rest and with rates (or momenta) of several sizes.

    Parameters without a value get one between 1/2 and 2.
    """
    drawn = random.Random(1)
    known_places = {
        x
        for body in bodies
        for x in (*body.motor, *body.variables, *(y for p in body.points for y in p.symbols))
    }
    held = function.free_symbols | {
        x for body in bodies for p in body.points for a in p.place for x in a.free_symbols
    }
    valueless = held - known_places - set(velocities) - set(parameters) - {TIME}
    samples = []
    with mpmath.workdps(_DIGITS):
        for size in _SIZES:
            known = values_of(parameters, drawn.uniform(0, 1))
            known |= {
                x: mpmath.mpf(drawn.uniform(0.5, 2))
                for x in sorted(valueless, key=lambda x: x.name)
            }
            for body in bodies:
                known = place(body, random_motor(body, drawn), known)
            known |= {x: mpmath.mpf(size * drawn.uniform(-1, 1)) for x in velocities}
            samples.append(known)
    return samples


def on_the_group(function: Expr, bodies: Sequence[Coordinates], velocities: Iterable[Expr]) -> Expr:
    """The function with RᵀR = 1 used wherever it makes R disappear from what velocities stand in.

    |R V|² is |V|², which SymPy cannot know.
    """
    moving = set(velocities)
    for body in bodies:
        if not body.space.affine:
            continue
        entries = {x for row in body.rotation for x in row}
        if not entries & function.free_symbols:
            continue
        d = range(body.dimension)
        relations = [
            sum(body.rotation[k][i] * body.rotation[k][j] for k in d) - (1 if i == j else 0)
            for i in d
            for j in range(i + 1)
        ]
        order = [body.rotation[k][j] for k in reversed(d) for j in d]

        def is_kinetic(x: Expr, entries: set[Expr] = entries) -> bool:
            return bool(x.is_Add and x.free_symbols & entries and x.free_symbols & moving)

        def reduced(x: Expr, relations: Any = relations, order: Any = order) -> Expr:
            try:
                _, rest = sympy.reduced(sympy.expand(x), relations, *order, order="lex")
            except sympy.PolynomialError:
                return x
            left = len(rest.free_symbols & set(order))
            return rest if left < len(x.free_symbols & set(order)) else x

        function = function.replace(is_kinetic, reduced)
    return function


def legendre_transform(
    function: Expr,
    old: Sequence[Expr],
    new: Sequence[Expr],
    parameters: Mapping[Expr, Expr],
    samples: Sequence[Values],
) -> Expr | None:
    """new·old − function, in the new variables: new_i = ∂function/∂old_i.

    parameters: values, put in where an inverse with symbols would be too long.
    samples: states by which a formula is chosen and checked. None where it does not close in
    formulas of bounded size.
    """
    with mpmath.workdps(_DIGITS):
        held: dict[Expr, Expr] = {}
        short = _abbreviated(function, set(old), held)
        abbreviations = list(held)
        longer = [
            values | dict(zip(held.values(), evaluated(abbreviations, values), strict=True))
            for values in samples
        ]
        transformed = _transform(short, old, new, parameters, longer)
    if transformed is None:
        return None
    return transformed.xreplace({symbol: x for x, symbol in held.items()})


def _abbreviated(x: Expr, variables: set[Expr], held: dict[Expr, Expr]) -> Expr:
    """x with symbols for its long parts that the variables are not in, which are put into held."""
    if not x.args or x.is_Number:
        return x
    if not x.free_symbols & variables:
        if sympy.count_ops(x) <= LONGEST_COEFFICIENT:
            return x
        return held.setdefault(x, sympy.Dummy("a", real=True))
    if x.is_Add or x.is_Mul:
        alone, rest = x.as_independent(*variables, as_Add=x.is_Add)
        parts = [_abbreviated(a, variables, held) for a in x.func.make_args(rest)]
        return x.func(_abbreviated(alone, variables, held), *parts)
    return x.func(*(_abbreviated(a, variables, held) for a in x.args))


def _transform(
    function: Expr,
    old: Sequence[Expr],
    new: Sequence[Expr],
    parameters: Mapping[Expr, Expr],
    samples: Sequence[Values],
) -> Expr | None:
    slopes = [sympy.diff(function, x) for x in old]
    rest = {x: sympy.Integer(0) for x in old}
    total = -function.subs(rest)
    for block in _blocks(slopes, old):
        part = _transformed_block(
            [slopes[i] for i in block],
            function,
            [old[i] for i in block],
            [new[i] for i in block],
            {x: zero for i, (x, zero) in enumerate(rest.items()) if i not in block},
            parameters,
            samples,
        )
        if part is None:
            return None
        total += part
    return total if _inverts(total, slopes, old, new, samples) else None


def _blocks(slopes: Sequence[Expr], old: Sequence[Expr]) -> list[list[int]]:
    """Sets of variables that ∂²f does not couple."""
    blocks: list[set[int]] = []
    for i, slope in enumerate(slopes):
        coupled = {i} | {j for j, x in enumerate(old) if x in slope.free_symbols}
        joined = [b for b in blocks if b & coupled]
        blocks = [b for b in blocks if not b & coupled] + [coupled.union(*joined)]
    return [sorted(b) for b in sorted(blocks, key=min)]


def _transformed_block(
    slopes: Sequence[Expr],
    function: Expr,
    old: Sequence[Expr],
    new: Sequence[Expr],
    others: Mapping[Expr, Expr],
    parameters: Mapping[Expr, Expr],
    samples: Sequence[Values],
) -> Expr | None:
    """The transform of the variables `old` alone, less the function at their zero."""
    hessian = sympy.Matrix([[sympy.diff(slope, x) for x in old] for slope in slopes])
    rest = {x: sympy.Integer(0) for x in old}
    shifted = [p - slope.subs(rest) for p, slope in zip(new, slopes, strict=True)]
    quadratic = not hessian.free_symbols & set(old)
    inverse = _inverse(hessian.subs(rest), parameters)
    if quadratic:
        return None if inverse is None else _form(inverse, shifted) / 2
    alone = function.subs(others)
    increase = alone - alone.subs(rest)
    if len(old) == 1:
        direct = _unwound(increase, old[0], new[0])
        if direct is not None:
            return direct
    if inverse is None:
        return None
    # b·B + g(√(BᵀKB)), followed along its first axis; any other form fails the final check.
    first = hessian[0, 0].subs(rest)
    length, size = sympy.Dummy("w", positive=True), sympy.Dummy("n", positive=True)
    along = {x: length if k == 0 else sympy.Integer(0) for k, x in enumerate(old)}
    profile = sympy.expand(increase.subs(along) - slopes[0].subs(rest) * length)
    found = _even_transform(profile, length, size, samples)
    return None if found is None else found.subs(size, sympy.sqrt(_form(inverse * first, shifted)))


def _inverse(matrix: Expr, parameters: Mapping[Expr, Expr]) -> Expr | None:
    """Exact; None if it is singular or too long."""
    size = matrix.rows
    if matrix.is_diagonal():
        if any(matrix[i, i] == 0 for i in range(size)):
            return None
        return sympy.diag(*(1 / matrix[i, i] for i in range(size)))
    symbolic = bool(matrix.free_symbols)
    if symbolic and sympy.count_ops(matrix) > MOST_INVERTED:
        return None
    common = next(x for x in matrix if x != 0)
    ratios = (matrix / common).applyfunc(sympy.cancel)
    if size > LARGEST_DENSE_SYMBOLIC:
        ratios = ratios.subs(parameters)
        if ratios.free_symbols:
            return None
    try:
        inverse = ratios.to_DM(field=True).inv().to_Matrix()
    except (sympy.polys.matrices.exceptions.DMNonInvertibleMatrixError, ZeroDivisionError):
        return None
    return None if symbolic and sympy.count_ops(inverse) > MOST_OPERATIONS else inverse / common


def _form(matrix: Expr, x: Sequence[Expr]) -> Expr:
    """xᵀ A x."""
    size = range(len(x))
    return sum(
        ((1 if i == j else 2) * matrix[i, j] * x[i] * x[j] for i in size for j in range(i + 1)),
        sympy.Integer(0),
    )


def _unwound(function: Expr, old: Expr, new: Expr) -> Expr | None:
    """The transform of a function of one variable that f' holds in one place."""
    slope = sympy.diff(function, old)
    solution = new
    while slope != old:
        held = [x for x in slope.args if old in x.free_symbols]
        if len(held) != 1:
            return None
        (inner,) = held
        others = [x for x in slope.args if x is not inner]
        if slope.is_Add:
            solution = solution - sympy.Add(*others)
        elif slope.is_Mul:
            solution = solution / sympy.Mul(*others)
        elif slope.func in _INVERSES:
            solution = _INVERSES[slope.func](solution)
        else:
            return None
        slope = inner
    return new * solution - function.subs(old, solution)


_INVERSES = {
    sympy.exp: sympy.log,
    sympy.sinh: lambda x: sympy.log(x + sympy.sqrt(x**2 + 1)),
    sympy.tanh: lambda x: sympy.log((1 + x) / (1 - x)) / 2,
    sympy.tan: sympy.atan,
    sympy.atan: sympy.tan,
    sympy.log: sympy.exp,
}


def _even_transform(function: Expr, old: Expr, new: Expr, samples: Sequence[Values]) -> Expr | None:
    """The transform of an algebraic function with f'² rational in the square of its variable."""
    positive = {
        x: sympy.Dummy(x.name, positive=True)
        for x in function.free_symbols - {old}
        if all(values.get(x, mpmath.mpf(0)) > 0 for values in samples)
    }
    back = {dummy: x for x, dummy in positive.items()}
    function = function.subs(positive)
    slope = sympy.diff(function, old)
    squared = sympy.cancel(sympy.expand_power_base(slope**2))
    if sympy.count_ops(slope) > MOST_SOLVED or not squared.is_rational_function(old):
        return None
    square = sympy.Dummy("w2", positive=True)
    equation = sympy.numer(sympy.together((squared - new**2).subs(old, sympy.sqrt(square))))
    if not equation.is_polynomial(square):
        return None
    for root in sympy.roots(sympy.Poly(equation, square), cubics=False, quartics=False):
        solution = _root(root, sympy.Rational(1, 2), new)
        if all(_is_solution(solution, new, slope, old, values, back) for values in samples):
            return _without_squares(new * solution - function.subs(old, solution), new).subs(back)
    return None


def _is_solution(
    solution: Expr, new: Expr, slope: Expr, old: Expr, values: Values, back: Mapping[Expr, Expr]
) -> bool:
    """Whether the solution is on the branch of f' that states are on."""
    values = values | {dummy: values[x] for dummy, x in back.items()}
    for length in (mpmath.mpf("0.01"), mpmath.mpf("0.3")):
        (size,) = evaluated([slope], values | {old: length})
        if not is_real([size]):
            continue
        (found,) = evaluated([solution], values | {new: size})
        if not is_real([found]) or abs(found - length) > mpmath.mpf(10) ** (10 - _DIGITS):
            return False
    return True


def _factored(x: Expr, variable: Expr) -> Expr:
    """As a function of the variable's square: c² − n² stays one factor."""
    square = sympy.Dummy("n2", positive=True)
    factors = sympy.factor(sympy.cancel(x).subs(variable, sympy.sqrt(square)))
    return factors.subs(square, variable**2)


def _root(x: Expr, exponent: Expr, variable: Expr) -> Expr:
    """A half-integer power of a fraction, as a fraction."""
    above, below = sympy.fraction(_factored(x, variable))
    return above**exponent / below**exponent


def _without_squares(x: Expr, new: Expr) -> Expr:
    """√(a n² + b) as one variable, so that what cancels does."""
    x = x.replace(
        lambda p: p.is_Pow and p.exp.is_Rational and p.exp.q == 2,
        lambda p: _root(p.base, p.exp, new),
    )
    radicals = {
        p.base for p in x.atoms(sympy.Pow) if p.exp.is_Rational and p.exp.q == 2 and p.has(new)
    }
    if len(radicals) != 1:
        return x
    (radicand,) = radicals
    a = sympy.expand(radicand).coeff(new, 2)
    root = sympy.Dummy("root", positive=True)
    rest = sympy.expand(radicand - a * new**2)
    if not a or rest.has(new):
        return x
    held = x.subs(radicand, root**2)
    reduced = sympy.cancel(sympy.expand(held).subs(new**2, (root**2 - rest) / a))
    return x if reduced.has(new) else sympy.expand(reduced).subs(root, sympy.sqrt(radicand))


def _agree(formula: Expr, wanted: Expr, given: Mapping[Expr, Expr], values: Values) -> bool:
    """Whether the formula, its arguments as given in terms of the state, has the wanted value.

    True outside the domain of what is given: nothing is said there.
    """
    arguments = evaluated([*given.values(), wanted], values)
    if not is_real(arguments):
        return True
    *found, target = arguments
    (value,) = evaluated([formula], values | dict(zip(given, found, strict=True)))
    if not is_real([value]):
        return False
    return bool(abs(value - target) <= mpmath.mpf(10) ** (10 - _DIGITS) * (1 + abs(target)))


def _inverts(
    transformed: Expr,
    slopes: Sequence[Expr],
    old: Sequence[Expr],
    new: Sequence[Expr],
    samples: Sequence[Values],
) -> bool:
    """Whether the slopes of the transform lead back, at every sampled state."""
    given = dict(zip(new, slopes, strict=True))
    return all(
        _agree(sympy.diff(transformed, p), x, given, values)
        for values in samples
        for p, x in zip(new, old, strict=True)
    )
