"""A Hamiltonian's equations of motion as text and as LaTeX, by components.

`ga`: Ṁ = M B, μ̇ = [μ, B] − M̃ F_s M over the group's generators. `classical`: x, R, Π, P and, with
a scale, s and q (theory.md §3, §5), on groups of rotations, translations and scalings.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import sympy
from sympy.printing.precedence import PRECEDENCE, precedence

from hamotor.errors import UsageError, suggest
from hamotor.mechanics.coordinates import Coordinates, Expr, Point
from hamotor.mechanics.hamiltonian import TIME, Hamiltonian, coadjoint
from hamotor.mechanics.naming import Generators

FORMS = ("ga", "classical")
STYLES = ("text", "latex")
WIDTH = 100
"""Characters of a line, unless a single term is longer."""
LARGEST_DENOMINATOR = 12
"""Fractions beyond are written as decimals."""
MOST_DIGITS = 10
"""Of a decimal; what has more is rounded."""
_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_GREEK = {"Pi": "Π", "Omega": "Ω", "tau": "τ", "mu": "μ"}


def equations(
    hamiltonian: Hamiltonian,
    form: str = "ga",
    style: str = "text",
) -> str:
    """All equations of motion, ending with a newline; parameters stay symbols, values are listed.

    UsageError for an unknown form or style, and where the classical form does not exist: on groups
    that bend straight lines or have other rotations than space, and for an H over components of M.
    """
    for what, value, allowed in (("form", form, FORMS), ("style", style, STYLES)):
        if value not in allowed:
            raise UsageError(
                f'unknown {what} "{value}"; there is {", ".join(allowed)}.{suggest(value, allowed)}'
            )
    names = _Names(hamiltonian, classical=form == "classical")
    sections = _classical(hamiltonian, names) if form == "classical" else _ga(hamiltonian, names)
    return _as_text(sections, names) if style == "text" else _as_latex(sections, names)


# ---------------------------------------------------------------- what there is to say


@dataclass(frozen=True)
class _Name:
    text: str
    latex: str


@dataclass(frozen=True)
class _Equation:
    """One left-hand side and what it equals, in turn: words as they are, expressions printed."""

    left: _Name
    right: tuple[Expr | _Name | tuple[Expr, ...], ...]


@dataclass(frozen=True)
class _Section:
    title: str
    equations: tuple[_Equation, ...]


@dataclass(frozen=True)
class _Names:
    """How symbols are written."""

    hamiltonian: Hamiltonian
    classical: bool

    @cached_property
    def lengths(self) -> dict[Expr, Expr]:
        """Symbols for the roots of sums in H, by root."""
        found = {
            p.base
            for p in self.hamiltonian.energy.atoms(sympy.Pow)
            if p.exp.is_Rational and p.exp.q == 2 and p.base.is_Add
        }
        roots = sorted(found, key=sympy.default_sort_key)
        symbols = [sympy.Dummy(f"r{k}", positive=True) for k in range(len(roots))]
        for k, symbol in enumerate(symbols, 1):
            self.of_symbols[symbol] = _indexed("r", str(k) if len(roots) > 1 else "")
        return {sympy.sqrt(x): symbol for x, symbol in zip(roots, symbols, strict=True)}

    def shortened(self, x: Expr) -> Expr:
        """With `lengths` by their symbols."""
        for root, symbol in self.lengths.items():
            x = x.replace(
                lambda p, root=root: p.is_Pow and p.base == root.base and p.exp.is_Rational,
                lambda p, symbol=symbol: symbol ** (2 * p.exp),
            )
        return x

    @cached_property
    def of_symbols(self) -> dict[Expr, _Name]:
        """Every symbol of the bodies; parameters are written as they are."""
        found = {TIME: _Name("t", "t")}
        for body in self.hamiltonian.bodies:
            found |= {x: self.of_body(body, name) for x, name in self._plain(body).items()}
        for parameter in self.hamiltonian.parameters:
            found[parameter] = _Name(parameter.name, _parameter_latex(parameter.name))
        return found

    def of_body(self, body: Coordinates, name: _Name) -> _Name:
        """With the body, where there are several."""
        if not body.prefix:
            return name
        mark = body.body.replace("_", r"\_")
        return _Name(f"{body.prefix}{name.text}", rf"{name.latex}^{{\mathrm{{{mark}}}}}")

    def _plain(self, body: Coordinates) -> dict[Expr, _Name]:
        found: dict[Expr, _Name] = {}
        for j, row in enumerate(body.rotation, 1):
            found |= {x: _indexed("R", f"{j}{k}") for k, x in enumerate(row, 1)}
        if body.space.scales:
            found[body.scale] = _Name("s", "s")
        if not body.space.affine:
            for j, row in enumerate(body.conformal_matrix):
                found |= {x: _indexed("L", f"{j}{k}") for k, x in enumerate(row)}
        for point in body.points:
            letter = self.point(body, point)
            for k, x in enumerate(point.symbols, 1):
                found[x] = _indexed(letter, str(k))
        for x, component in zip(body.motor, body.group.element.components, strict=True):
            index = _index_latex(component.name) if component.name != "s" else r"\mathrm{s}"
            found[x] = _Name(f"M.{component.name}", f"M_{{{index}}}")
        for x, name in zip(body.momenta, self.momenta(body), strict=True):
            found[x] = name
        for x, name in zip(body.rates, self.rates(body), strict=True):
            found[x] = name
        return found

    @staticmethod
    def point(body: Coordinates, point: Point) -> str:
        """x for the origin; y, y′, y″ for others."""
        if not any(point.place):
            return "x"
        others = [p for p in body.points if any(p.place)]
        return "y" + "′" * others.index(point)

    def momenta(self, body: Coordinates) -> list[_Name]:
        """Of the components of μ."""
        plain = [_lettered(g.momentum, {"l": r"\ell"}) for g in body.group.generators]
        return self._parts(body, plain, "Pi", "P", "q")

    def rates(self, body: Coordinates) -> list[_Name]:
        """Of the components of B."""
        plain = [_lettered(g.rate, {"w": r"\omega"}) for g in body.group.generators]
        return self._parts(body, plain, "Omega", "V", "d")

    def forques(self, body: Coordinates) -> list[_Name]:
        """Of the components of F."""
        plain = [
            _Name(f"F{g.name[1:]}", f"F_{{{_index_latex(g.name)}}}") for g in body.group.generators
        ]
        return self._parts(body, plain, "tau", "f", "h")

    def _parts(
        self, body: Coordinates, plain: list[_Name], turning: str, moving: str, growing: str
    ) -> list[_Name]:
        if not self.classical:
            return plain
        parts = Generators.of(body)
        found = [_Name(growing, growing)] * len(plain)
        for letter, indices in ((turning, parts.turning), (moving, parts.moving)):
            for k, i in enumerate(indices, 1):
                found[i] = _indexed(letter, str(k) if len(indices) > 1 else "")
        return found


def _indexed(letter: str, index: str) -> _Name:
    text = _GREEK.get(letter, letter)
    latex = f"\\{letter}" if letter in _GREEK else letter
    primes = latex.count("′")
    latex = latex.replace("′", "") + "'" * primes
    return _Name(text + index.translate(_SUBSCRIPTS), f"{latex}_{{{index}}}" if index else latex)


def _lettered(name: str, letters: Mapping[str, str]) -> _Name:
    letter = letters.get(name[0], name[0])
    return _Name(name, f"{letter}_{{{name[1:]}}}" if name[1:] else letter)


def _index_latex(blade: str) -> str:
    return blade.removeprefix("e").replace("i", r"\infty")


def _parameter_latex(name: str) -> str:
    """`J1` with a subscript, other names upright if they are words."""
    match = re.fullmatch(r"([A-Za-z])_?([0-9]+)", name)
    if match:
        return f"{match[1]}_{{{match[2]}}}"
    return name if len(name) == 1 else rf"\mathrm{{{name}}}".replace("_", r"\_")


def _ga(h: Hamiltonian, names: _Names) -> list[_Section]:
    sections = _opening(h, names)
    law = [_Equation(_Name("dM/dt", r"\dot M"), (_Name("M B", "M B"),))]
    law.append(
        _Equation(
            _Name("dμ/dt", r"\dot\mu"),
            (_Name("[μ, B] − M̃ F_s M", r"[\mu, B] - \tilde M F_{\mathrm s} M"),),
        )
    )
    body = h.bodies[0]
    basis = [
        (rate, _Name(f"E{g.name[1:]}", f"E_{{{_index_latex(g.name)}}}"))
        for g, rate in zip(body.group.generators, names.rates(body), strict=True)
    ]
    spelled = _Name(
        " + ".join(f"{rate.text} {e.text}" for rate, e in basis),
        " + ".join(f"{rate.latex} {e.latex}" for rate, e in basis),
    )
    law.append(_Equation(_Name("B", "B"), (spelled,)))
    for g, (_, e) in zip(body.group.generators, basis, strict=True):
        law.append(_Equation(e, (_bivector(g.bivector, body),)))
    sections.append(
        _Section("Motion, M the motor, B = ∂H/∂μ its rate, F = M̃ F_s M = dH", tuple(law))
    )
    for k, body in enumerate(h.bodies):
        found = []
        for variable in body.motor_variables:
            change = zip(body.rates, variable.variation, strict=True)
            total = sum((b * v for b, v in change), sympy.Integer(0))
            found.append(_Equation(_derivative(names.of_symbols[variable.symbol]), (total,)))
        sections.append(_Section(f"Motor{_of(body)}", tuple(found)))
        sections += _dynamics(h, k, names, "Rates B = ∂H/∂μ", "Forques F")
    return sections


def _bivector(bivector: Mapping[int, object], body: Coordinates) -> _Name:
    algebra = body.algebra
    texts, latexes = [], []
    for blade, x in bivector.items():
        indices = [name.removeprefix("e") for k, name in enumerate(algebra.basis) if blade >> k & 1]
        text = "∧".join(f"e{i}" for i in indices)
        latex = r" \wedge ".join(f"e_{{{i}}}".replace("{i}", r"{\infty}") for i in indices)
        number = sympy.Rational(str(x))
        texts.append(f"{_text(number, {})} {text}")
        latexes.append(f"{_latex(number, {})} {latex}")
    return _Name(" + ".join(texts), " + ".join(latexes))


def _of(body: Coordinates) -> str:
    return f" of {body.body}" if body.prefix else ""


def _derivative(name: _Name) -> _Name:
    return _Name(
        f"d{name.text}/dt" if "." not in name.text else f"d({name.text})/dt",
        rf"\frac{{d}}{{dt}} {name.latex}",
    )


def _dynamics(
    h: Hamiltonian, k: int, names: _Names, of_rates: str, of_forques: str
) -> list[_Section]:
    """B, F and μ̇ by components, the last in rates and forques and then with both put in."""
    body, rates = h.bodies[k], [names.shortened(x) for x in h.rates[k]]
    rate_names = [names.of_body(body, n) for n in names.rates(body)]
    momentum_names = [names.of_body(body, n) for n in names.momenta(body)]
    forque_names = [names.of_body(body, n) for n in names.forques(body)]
    gradients, forques = _forques(h, k, names)
    symbols = [sympy.Dummy(f"F{i}", real=True) for i in range(len(forques))]
    names.of_symbols.update(zip(symbols, forque_names, strict=True))
    acting = [f if x != 0 else x for f, x in zip(symbols, forques, strict=True)]
    inertial = coadjoint(body, body.rates)
    put_in = coadjoint(body, tuple(rates))
    motion = []
    for i, name in enumerate(momentum_names):
        short = inertial[i] - acting[i]
        whole = sympy.expand(put_in[i]) - forques[i]
        steps = (short,) if whole == short else (short, whole)
        motion.append(_Equation(_derivative(name), steps))
    of_this = _of(body)
    sections = [
        _Section(
            f"{of_rates}{of_this}",
            tuple(_Equation(n, (x,)) for n, x in zip(rate_names, rates, strict=True)),
        ),
        _Section(f"Gradients{of_this}", tuple(gradients)),
        _Section(
            f"{of_forques}{of_this}",
            tuple(_Equation(n, (x,)) for n, x in zip(forque_names, forques, strict=True) if x != 0),
        ),
        _Section(f"Momenta{of_this}", tuple(motion)),
    ]
    return [section for section in sections if section.equations]


def _forques(h: Hamiltonian, k: int, names: _Names) -> tuple[list[_Equation], list[Expr]]:
    """∂H/∂y at points, where it is no constant, and F in these."""
    body = h.bodies[k]
    size = range(len(body.rates))
    total = list(h.applied[k]) if h.applied else [sympy.Integer(0) for _ in size]
    for variable, slope in h.slopes(body):
        for i in size:
            total[i] += slope * variable.variation[i]
    found = []
    constants = set(h.parameters)
    for point, gradient in h.gradients(body):
        written = []
        for y, slope in zip(point.symbols, gradient, strict=True):
            if slope.free_symbols <= constants:
                written.append(slope)
                continue
            symbol, own = sympy.Dummy(f"H{y.name}", real=True), names.of_symbols[y]
            name = _Name(f"∂H/∂{own.text}", f"H_{{{own.latex}}}")
            names.of_symbols[symbol] = name
            found.append(_Equation(name, (names.shortened(slope),)))
            written.append(symbol)
        pulled = body.pulled_back(tuple(written))
        for i in size:
            total[i] += sum(v * g for v, g in zip(point.velocities[i], pulled, strict=True))
    return found, [names.shortened(sympy.expand(x)) for x in total]


def _opening(h: Hamiltonian, names: _Names) -> list[_Section]:
    energy = _Equation(_Name("H", "H"), (names.shortened(h.energy),))
    lengths = [_Equation(names.of_symbols[r], (x,)) for x, r in names.lengths.items()]
    sections = [_Section("Hamiltonian", (energy, *lengths))]
    values = [
        _Equation(names.of_symbols[symbol], (value,)) for symbol, value in h.parameters.items()
    ]
    if values:
        sections.append(_Section("Parameters", tuple(values)))
    for body in h.bodies:
        found = _places(h, body, names)
        if found:
            sections.append(_Section(f"Places{_of(body)}", tuple(found)))
    return sections


def _places(h: Hamiltonian, body: Coordinates, names: _Names) -> list[_Equation]:
    """What the variables are that H and its forques hold."""
    k = h.bodies.index(body)
    held = set(h.energy.free_symbols)
    held |= {s for x in (*h.all_forques[k], *h.rates[k]) for s in x.free_symbols}
    found = []
    for point in body.points_in(held):
        letter = names.of_body(body, _indexed(names.point(body, point), ""))
        held |= {r for row in body.rotation for r in row}
        if not any(point.place):
            if not names.classical:
                for symbol, x in zip(point.symbols, body.origin, strict=True):
                    found.append(_Equation(names.of_symbols[symbol], (x,)))
            continue
        place = "(" + ", ".join(_text(a, names.of_symbols) for a in point.place) + ")"
        place_latex = "(" + ", ".join(_latex(a, names.of_symbols) for a in point.place) + ")"
        scale = "s " if body.space.scales else ""
        start = "x + " if body.space.translates else ""
        if body.prefix:
            scale, start = (
                part.replace("s", f"{body.prefix}s").replace("x", f"{body.prefix}x")
                for part in (scale, start)
            )
        turned = f"{body.prefix}R"
        found.append(
            _Equation(
                letter,
                (
                    _Name(
                        f"{start}{scale}{turned} {place}",
                        f"x + {scale}R {place_latex}" if start else f"{scale}R {place_latex}",
                    ),
                ),
            )
        )
    if not names.classical:
        for variable in body.frame_variables:
            if variable.symbol in held:
                written = (variable.definition,)
                found += [_Equation(names.of_symbols[variable.symbol], written)]
    return found


def _classical(h: Hamiltonian, names: _Names) -> list[_Section]:
    body = h.bodies[0]
    parts = Generators.of(body)
    known = {*parts.turning, *parts.moving}
    growing = [i for i, kind in enumerate(parts.kinds) if kind == "dilation"]
    if not body.space.affine or len(known) + len(growing) != len(parts.kinds):
        raise UsageError(
            f"{body.group.name} has no classical form x, R, Π, P; show the equations in GA"
        )
    for each in h.bodies:
        if set(each.motor) & h.energy.free_symbols:
            raise UsageError(
                "H speaks of the motor's components, which the classical form has not; "
                "show the equations in GA"
            )
    sections = _opening(h, names)
    law = _classical_law(h, parts)
    point = "x + s R a" if growing else "x + R a" if parts.moving else "R a"
    sections.append(_Section(f"Motion; points of a body are y = {point}, rows of R are r", law))
    rates = (("Ω = ∂H/∂Π", parts.turning), ("V = ∂H/∂P", parts.moving), ("d = ∂H/∂q", growing))
    title = "Rates " + ", ".join(rate for rate, there in rates if there)
    for k in range(len(h.bodies)):
        sections += _dynamics(h, k, names, title, "Forques")
    return sections


def _classical_law(h: Hamiltonian, parts: Generators) -> tuple[_Equation, ...]:
    """The vector equations, each term only where the group and H have it."""
    body = h.bodies[0]
    turns, moves, grows = bool(parts.turning), bool(parts.moving), body.space.scales
    gradients = [point for each in h.bodies for point, _ in h.gradients(each)]
    pulls, leverage = bool(gradients), any(any(point.place) for point in gradients)
    slopes = {variable.symbol for each in h.bodies for variable, _ in h.slopes(each)}
    scales = {each.scale for each in h.bodies}
    applied = any(x != 0 for forque in h.applied for x in forque)
    s = "s " if grows else ""
    pull, pull_latex = f"{s}Rᵀ ∂H/∂y", s + r"R^{\mathsf T} H_y"
    space = body.dimension == 3
    laws: list[tuple[bool, str, str, list[tuple[bool, str, str]]]] = [
        (moves, "dx/dt", r"\dot x", [(True, f" + {s}R V", f" + {s}R V")]),
        (turns, "dR/dt", r"\dot R", [(True, " + R Ω̂", r" + R \hat\Omega")]),
        (grows, "ds/dt", r"\dot s", [(True, " + s d", " + s d")]),
        (
            turns,
            "dΠ/dt",
            r"\dot\Pi",
            [
                (space, " + Π × Ω", r" + \Pi \times \Omega"),
                (moves, " + P × V", r" + P \times V"),
                (True, " − τ", r" - \tau"),
            ],
        ),
        (
            moves,
            "dP/dt",
            r"\dot P",
            [
                (turns, " + P × Ω", r" + P \times \Omega"),
                (grows, " + d P", " + d P"),
                (True, " − f", " - f"),
            ],
        ),
        (
            grows,
            "dq/dt",
            r"\dot q",
            [(moves, " − P · V", r" - P \cdot V"), (True, " − h", " - h")],
        ),
        (
            turns,
            "τ",
            r"\tau",
            [
                (leverage, f" + Σ a × {pull}", rf" + \sum a \times {pull_latex}"),
                (bool(slopes - scales), " − Σ r × ∂H/∂r", r" - \sum r \times H_r"),
                (applied, " + τ₀", r" + \tau_0"),
            ],
        ),
        (
            moves,
            "f",
            "f",
            [
                (pulls, f" + Σ {pull}", rf" + \sum {pull_latex}"),
                (applied, " + f₀", " + f_0"),
            ],
        ),
        (
            grows,
            "h",
            "h",
            [
                (leverage, f" + Σ a · {pull}", rf" + \sum a \cdot {pull_latex}"),
                (bool(slopes & scales), " + s ∂H/∂s", " + s H_s"),
                (applied, " + h₀", " + h_0"),
            ],
        ),
    ]
    found = []
    for there, left, left_latex, terms in laws:
        text = "".join(term for held, term, _ in terms if held) or " + 0"
        latex = "".join(term for held, _, term in terms if held) or " + 0"
        text = ("−" if text.startswith(" −") else "") + text[3:]
        latex = ("-" if latex.startswith(" -") else "") + latex[3:]
        if there:
            found.append(_Equation(_Name(left, left_latex), (_Name(text, latex),)))
    return tuple(found)


# ---------------------------------------------------------------- expressions


def _number(x: Expr) -> str:
    """A positive rational: whole, a fraction of small numbers, or a decimal."""
    if x.q <= LARGEST_DENOMINATOR and x.q % 5 and x.p < 10**MOST_DIGITS:
        return str(x)
    return f"{float(x):.{MOST_DIGITS}g}"


def _latex(x: Expr, names: Mapping[Expr, _Name]) -> str:
    return _Printer(names, latex=True).shown(x)


def _text(x: Expr, names: Mapping[Expr, _Name]) -> str:
    return _Printer(names, latex=False).shown(x)


@dataclass(frozen=True)
class _Printer:
    """Unicode with superscripts and √, or LaTeX; a space for products, numbers first."""

    names: Mapping[Expr, _Name]
    latex: bool

    def shown(self, x: Expr) -> str:
        if x.is_Symbol:
            name = self.names.get(x) or _Name(x.name, _parameter_latex(x.name))
            return name.latex if self.latex else name.text
        if x.is_Rational:
            return self.minus + self._number(-x) if x < 0 else self._number(x)
        if x.is_Add:
            return self._sum(x)
        if x.is_Mul:
            return self._product(x)
        if x.is_Pow:
            return self._power(x)
        return self._function(x.func.__name__.lower(), x.args)

    @property
    def minus(self) -> str:
        return "-" if self.latex else "−"

    def _function(self, name: str, arguments: Sequence[Expr]) -> str:
        listed = ", ".join(self.shown(a) for a in arguments)
        if self.latex:
            return rf"\operatorname{{{name}}}\left({listed}\right)"
        return f"{name}({listed})"

    def _number(self, x: Expr) -> str:
        text = _number(x)
        if not self.latex:
            return text
        if "/" in text:
            return rf"\frac{{{x.p}}}{{{x.q}}}"
        mantissa, _, exponent = text.partition("e")
        return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa

    def _sum(self, x: Expr) -> str:
        text = ""
        for term in x.as_ordered_terms():
            part = self.shown(term)
            if not text:
                text = part
            elif part.startswith(self.minus):
                text += f" {self.minus} {part[1:]}"
            else:
                text += f" + {part}"
        return text

    def _within(self, x: Expr, level: int) -> str:
        text = self.shown(x)
        if precedence(x) >= level:
            return text
        return rf"\left({text}\right)" if self.latex else f"({text})"

    def _product(self, x: Expr) -> str:
        coefficient, rest = x.as_coeff_Mul()
        above, below = [], []
        for factor in sympy.Mul.make_args(rest):
            if factor.is_Pow and factor.exp.is_Rational and factor.exp < 0:
                below.append(1 / factor)
            elif factor != 1:
                above.append(factor)
        size = abs(coefficient)
        if size.q > 1 and "/" in _number(size):
            below.insert(0, sympy.Integer(size.q))
            size = sympy.Integer(size.p)
        # Derivatives last, so that nothing seems to be under them.
        above.sort(key=lambda f: self.shown(f).startswith("∂"))
        if size != 1 or not above:
            above.insert(0, size)
        text = self._factors(above)
        if below and self.latex:
            text = rf"\frac{{{text}}}{{{self._factors(below)}}}"
        elif below:
            text += f"/({self._factors(below)})" if len(below) > 1 else f"/{self._factors(below)}"
        return f"{self.minus}{text}" if coefficient < 0 else text

    def _factors(self, factors: Sequence[Expr]) -> str:
        if self.latex and len(factors) == 1:
            return self.shown(factors[0])
        return " ".join(self._within(f, PRECEDENCE["Mul"]) for f in factors)

    def _power(self, x: Expr) -> str:
        if x.exp == sympy.Rational(1, 2):
            base = self.shown(x.base)
            if self.latex:
                return rf"\sqrt{{{base}}}"
            return f"√{base}" if x.base.is_Symbol or x.base.is_Integer else f"√({base})"
        if x.base is sympy.E:
            return self._function("exp", [x.exp])
        if x.exp.is_Rational and x.exp < 0:
            under = 1 / x
            if self.latex:
                return rf"\frac{{1}}{{{self.shown(under)}}}"
            return f"1/{self._within(under, PRECEDENCE['Pow'])}"
        base = self._within(x.base, PRECEDENCE["Atom"])
        if self.latex:
            marked = f"{{{base}}}" if "^" in base else base
            return f"{marked}^{{{self.shown(x.exp)}}}"
        if x.exp.is_Integer:
            return base + str(x.exp).translate(_SUPERSCRIPTS)
        return f"{base}^({self.shown(x.exp)})"


# ---------------------------------------------------------------- pages


def _as_text(sections: Sequence[_Section], names: _Names) -> str:
    lines = []
    for section in sections:
        lines += ["", section.title]
        width = max(len(e.left.text) for e in section.equations)
        for equation in section.equations:
            left = equation.left.text.ljust(width)
            for right in equation.right:
                lines += _wrapped(f"  {left} = ", _right_text(right, names))
                left = " " * width
    return "\n".join(lines[1:]) + "\n"


def _right_text(right: Expr | _Name | tuple[Expr, ...], names: _Names) -> str:
    if isinstance(right, _Name):
        return right.text
    if isinstance(right, tuple):
        return "(" + ", ".join(_text(x, names.of_symbols) for x in right) + ")"
    return _text(right, names.of_symbols)


def _wrapped(start: str, text: str) -> list[str]:
    """Lines of at most WIDTH characters, broken before + and − and after commas."""
    parts = re.split(r"(?= [+−] )|(?<=,)(?= )", text)
    lines, line = [], start + parts[0]
    for part in parts[1:]:
        if len(line) + len(part) > WIDTH:
            lines.append(line)
            line = " " * len(start) + part.lstrip()
        else:
            line += part
    return [*lines, line]


def _as_latex(sections: Sequence[_Section], names: _Names) -> str:
    lines: list[str] = []
    for section in sections:
        lines += [rf"\paragraph{{{_title_latex(section.title)}}}", r"\begin{align*}"]
        rows = []
        for equation in section.equations:
            left = equation.left.latex
            for right in equation.right:
                first, *more = _right_latex(right, names)
                rows.append(f"  {left} &= {first}")
                rows += [rf"  &\quad {part}" for part in more]
                left = ""
        lines += [f"{row} \\\\" for row in rows[:-1]]
        lines += [rows[-1], r"\end{align*}"]
    return "\n".join(lines) + "\n"


_TITLE = {
    "M̃": r"$\tilde M$",
    "F_s": r"$F_{\mathrm s}$",
    "∂": r"$\partial$",
    "μ": r"$\mu$",
    "Ω": r"$\Omega$",
    "Π": r"$\Pi$",
    "_": r"\_",
}


def _title_latex(title: str) -> str:
    pattern = "|".join(map(re.escape, _TITLE))
    return re.sub(pattern, lambda m: _TITLE[m[0]], title)


def _right_latex(right: Expr | _Name | tuple[Expr, ...], names: _Names) -> list[str]:
    if isinstance(right, _Name):
        return [right.latex]
    if isinstance(right, tuple):
        parts = [_latex(x, names.of_symbols) for x in right]
        return [r"\bigl(" + r",\; ".join(parts) + r"\bigr)"]
    lines: list[str] = []
    for term in right.as_ordered_terms():
        part = _latex(term, names.of_symbols)
        if not part.startswith("-") and lines:
            part = f"+ {part}"
        if lines and _visible(lines[-1] + part) <= WIDTH:
            lines[-1] += f" {part}"
        else:
            lines.append(("{} " if lines else "") + part)
    return lines


def _visible(latex: str) -> int:
    """About how many characters are seen."""
    return len(re.sub(r"\\[a-zA-Z]+|[{}_^\\ ]", "", latex))
