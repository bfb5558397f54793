"""Second-order averages of a massive spheroid in shear flow, in exact rational arithmetic (`docs/second-order.md`).

Run ``python docs/derivations/spheroid_second_order.py``: it prints the coefficients that stand in
`polhode.models.second_order.spheroid`, after checking with three exact orientations of the flow
that nothing is left over. Plain Python, no library.

L is in units of I_e. Frame: n = L/l is e₃, the symmetry axis is p = (r cos φ, r sin φ, h), r² = 1 -
h², z = e^{iφ}. The angle φ grows at unit rate in the independent variable s, ds/dt = l. The torque
over I_e is (`ultima`, with Jeffery's angular velocity put in)

    T = -D L - d p(p·L) + D W + c p(p·W) + k p×Ep,

with D = 8πY/I_e, D + d = 8πX/I_a, D + c = 8πX/I_e, k = DΛ, Λ = (κ²-1)/(κ²+1); W and E are the
flow's angular velocity and rate of strain.
"""

from collections.abc import Iterator
from fractions import Fraction
from functools import reduce
from typing import Any

Powers = tuple[int, ...]
Vector = list[Any]
Template = dict[str, list[tuple[int, int, Fraction]]]

NAMES = ("i", "z", "l", "h", "r", "D", "d", "c", "k")
I_, Z, H, R = NAMES.index("i"), NAMES.index("z"), NAMES.index("h"), NAMES.index("r")


class Poly:
    """Laurent polynomial in `NAMES` with rational coefficients; i² = -1 and r² = 1 - h² are used up."""

    def __init__(self, terms: dict[Powers, Fraction]) -> None:
        self.terms = {}
        for powers, value in terms.items():
            self._add(powers, value)
        self.terms = {powers: value for powers, value in self.terms.items() if value}

    def _add(self, powers: Powers, value: Fraction) -> None:
        if powers[R] >= 2:
            lower = _with(powers, R, powers[R] - 2)
            self._add(lower, value)
            self._add(_with(lower, H, lower[H] + 2), -value)
            return
        turns = powers[I_] % 4
        powers, value = _with(powers, I_, turns % 2), -value if turns >= 2 else value
        self.terms[powers] = self.terms.get(powers, 0) + value

    def __add__(self, other: "Poly | Fraction | int") -> "Poly":
        terms = dict(self.terms)
        for powers, value in _poly(other).terms.items():
            terms[powers] = terms.get(powers, 0) + value
        return Poly(terms)

    def __mul__(self, other: "Poly | Fraction | int") -> "Poly":
        terms = {}
        for p, a in self.terms.items():
            for q, b in _poly(other).terms.items():
                powers = tuple(map(sum, zip(p, q, strict=True)))
                terms[powers] = terms.get(powers, 0) + a * b
        return Poly(terms)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> "Poly":
        return self * -1

    def __sub__(self, other: "Poly | Fraction | int") -> "Poly":
        return self + -_poly(other)

    def mean(self) -> "Poly":
        """Average over φ."""
        return Poly({p: v for p, v in self.terms.items() if p[Z] == 0})

    def integral(self) -> "Poly":
        """Antiderivative over φ of zero mean, of the part of zero mean."""
        shifted = {_with(p, I_, p[I_] - 1): v / p[Z] for p, v in self.terms.items() if p[Z]}
        return Poly(shifted)

    def __str__(self) -> str:
        rows = []
        for powers, value in sorted(self.terms.items()):
            factors = [n if k == 1 else f"{n}^{k}" for n, k in zip(NAMES, powers, strict=True) if k]
            rows.append(" ".join([f"{value}", *factors]))
        return " + ".join(rows) or "0"


def _with(powers: Powers, index: int, power: int) -> Powers:
    return (*powers[:index], power, *powers[index + 1 :])


def _poly(value: Poly | Fraction | int) -> Poly:
    return value if isinstance(value, Poly) else Poly({(0,) * len(NAMES): Fraction(value)})


def symbol(name: str, power: int = 1) -> Poly:
    """A variable to a power."""
    return Poly({_with((0,) * len(NAMES), NAMES.index(name), power): Fraction(1)})


def dot(a: Vector, b: Vector) -> Any:
    """Scalar product."""
    return reduce(lambda x, y: x + y, (x * y for x, y in zip(a, b, strict=True)))


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def add(*vectors: Vector) -> Vector:
    """Sum of vectors."""
    return [reduce(lambda x, y: x + y, entries) for entries in zip(*vectors, strict=True)]


def times(factor: Any, vector: Vector) -> Vector:
    """Multiple of a vector."""
    return [factor * entry for entry in vector]


def apply(matrix: list[Vector], vector: Vector) -> Vector:
    """Matrix times vector."""
    return [dot(row, vector) for row in matrix]


L, H_, R_ = symbol("l"), symbol("h"), symbol("r")
COS = (symbol("z") + symbol("z", -1)) * Fraction(1, 2)
SIN = (symbol("z") - symbol("z", -1)) * symbol("i", -1) * Fraction(1, 2)
N, M = [_poly(0), _poly(0), _poly(1)], [_poly(0), _poly(0), L]
P = [R_ * COS, R_ * SIN, H_]
D, EXCESS, C, K = (symbol(name) for name in "Ddck")


def averages(spin: Vector, strain: list[Vector]) -> tuple[Vector, Poly, Vector]:
    """Averages F₁ and F₂ of (L, h), and F₁ of φ times r², per unit slow time, for a flow given in the frame of L."""
    torque = add(
        times(-D, M), times(-EXCESS * dot(P, M), P), times(D, spin), times(C * dot(P, spin), P),
        times(K, cross(P, apply(strain, P))),
    )  # fmt: skip

    def torque_change(dm: Vector, dp: Vector) -> Vector:
        radial = -EXCESS * (dot(dp, M) + dot(P, dm)) + C * dot(dp, spin)
        return add(
            times(-D, dm), times(-EXCESS * dot(P, M) + C * dot(P, spin), dp), times(radial, P),
            times(K, add(cross(dp, apply(strain, P)), cross(P, apply(strain, dp)))),
        )  # fmt: skip

    over = symbol("l", -1)
    rate_m = times(over, torque)
    wobble = dot(torque, P) - H_ * torque[2]
    rate_h = over * over * wobble
    # p stays where it is while n turns: δφ = -h e₃·(p × δn)/r².
    rate_phi = -H_ * symbol("r", -1) * (COS * rate_m[1] - SIN * rate_m[0]) * over

    u_m, u_h, u_phi = [rate.integral() for rate in rate_m], rate_h.integral(), rate_phi.integral()
    u_n = times(over, [u_m[0], u_m[1], _poly(0)])
    along_h = [-H_ * symbol("r", -1) * COS, -H_ * symbol("r", -1) * SIN, _poly(1)]
    u_p = add(
        times(H_, u_n), times(-dot(u_n, P), N), times(u_h, along_h), times(u_phi, cross(N, P))
    )
    change = torque_change(u_m, u_p)
    second_m = [(j - u_m[2] * over * t).mean() for j, t in zip(change, torque, strict=True)]
    wobble_change = (
        dot(change, P) + dot(torque, u_p) - u_h * torque[2] - H_ * change[2] - H_ * dot(torque, u_n)
    )  # fmt: skip
    second_h = (over * wobble_change - 2 * over * over * u_m[2] * wobble).mean()
    first = [(L * rate).mean() for rate in (*rate_m, rate_h)]
    return first, (L * symbol("r", 2) * rate_phi).mean(), [*second_m, second_h]


def flow_frame(a: int, b: int, c: int, d: int) -> list[Vector]:
    """Rows x, y, z: the flow's axes in the frame of L, from an integer quaternion."""
    norm = a * a + b * b + c * c + d * d
    rows = [
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ]
    return [[Fraction(entry, norm) for entry in row] for row in rows]


def forms(frame: list[Vector]) -> tuple[Vector, list[Vector], Vector, Vector, Fraction, Fraction]:
    """Flow (W, E) and the vectors and scalars that the averages are made of: S_n, its part across n, W_n, s₀, w₀."""
    x, y, z = frame
    half = Fraction(1, 2)
    strain = [[half * (x[i] * y[j] + y[i] * x[j]) for j in range(3)] for i in range(3)]
    spin = [-half * entry for entry in z]
    s_n = [strain[i][2] for i in range(3)]
    w_n = [half * (x[i] * y[2] - y[i] * x[2]) for i in range(3)]
    across = [s_n[0], s_n[1], Fraction(0)]
    return spin, strain, across, w_n, s_n[2], half * z[2]


def solve(rows: list[list[Fraction]], values: list[Poly]) -> list[Poly]:
    """Rational solution of a linear system of full column rank with polynomials on its right; more rows are ignored."""
    rows, values, size = [list(row) for row in rows], list(values), len(rows[0])
    for i in range(size):
        pivot = next(j for j in range(i, len(rows)) if rows[j][i])
        rows[i], rows[pivot], values[i], values[pivot] = (
            rows[pivot],
            rows[i],
            values[pivot],
            values[i],
        )
        for j in range(len(rows)):
            if j != i and rows[j][i]:
                factor = rows[j][i] / rows[i][i]
                rows[j] = [a - factor * b for a, b in zip(rows[j], rows[i], strict=True)]
                values[j] = values[j] - values[i] * factor
    return [values[i] * (1 / rows[i][i]) for i in range(size)]


def by_power(polynomial: Poly, power: int) -> Poly:
    """Coefficient of a power of ℓ."""
    index = NAMES.index("l")
    return Poly({_with(p, index, 0): v for p, v in polynomial.terms.items() if p[index] == power})


def turned(vector: Vector) -> Vector:
    """n × vector."""
    return [-vector[1], vector[0], Fraction(0)]


def templates(frame: list[Vector]) -> tuple[Template, Template]:
    """Per unknown: (component, power of ℓ, factor), components 0–2 of L, 3 of h, 4 of r² φ."""
    _, _, across, w_n, s0, w0 = forms(frame)
    first = {
        "f0": [(2, 1, Fraction(1))], "f2": [(2, 0, w0)], "g0": [(3, 0, Fraction(1))], "g2": [(3, -1, w0)],
        "r1": [(i, 0, turned(across)[i]) for i in (0, 1)], "r2": [(i, 0, turned(w_n)[i]) for i in (0, 1)],
        "r2 e": [(4, -1, s0)],
    }  # fmt: skip
    second = {
        "a1": [(2, -1, s0)], "a2": [(2, -2, s0 * w0)], "b1": [(3, -2, s0)], "b2": [(3, -3, s0 * w0)],
        "p1": [(i, -1, across[i]) for i in (0, 1)], "p2": [(i, -1, w_n[i]) for i in (0, 1)],
        "p3": [(i, -2, s0 * turned(across)[i]) for i in (0, 1)], "p4": [(i, -2, s0 * turned(w_n)[i]) for i in (0, 1)],
        "p5": [(i, -2, w0 * across[i]) for i in (0, 1)], "p6": [(i, -2, w0 * w_n[i]) for i in (0, 1)],
    }  # fmt: skip
    return first, second


def equations(frame: list[Vector], order: int) -> Iterator[tuple[int, int, list[Fraction], Poly]]:
    """Per (component, power of ℓ): the row of template factors and the value, for one orientation of the flow."""
    spin, strain, *_ = forms(frame)
    first, phase, second = averages(spin, strain)
    values = [*first, phase] if order == 1 else second
    template = templates(frame)[order - 1]
    for component, value in enumerate(values):
        powers = {p[NAMES.index("l")] for p in value.terms} | {
            power
            for entries in template.values()
            for where, power, _ in entries
            if where == component
        }
        for power in sorted(powers):
            row = [
                sum((f for where, q, f in entries if (where, q) == (component, power)), Fraction(0))
                for entries in template.values()
            ]
            yield component, power, row, by_power(value, power)


def coefficients() -> dict[str, Poly]:
    """Coefficients by name, exact; each is a polynomial in h and the symbols of the torque.

    Raises
    ------
    ArithmeticError
        If an average is not made of the templates alone.
    """
    frames = [flow_frame(*numbers) for numbers in ((1, 2, 3, 5), (2, -1, 4, 3), (3, 1, -2, 7))]
    found = {}
    for order in (1, 2):
        names = list(templates(frames[0])[order - 1])
        rows = [entry for frame in frames for entry in equations(frame, order)]
        for power in sorted({entry[1] for entry in rows}):
            for component in (0, 2, 3, 4):
                here = [
                    e
                    for e in rows
                    if e[1] == power and (e[0] == component or e[0] == component + 1 == 1)
                ]
                columns = [j for j in range(len(names)) if any(e[2][j] for e in here)]
                if columns:
                    values = solve([[e[2][j] for j in columns] for e in here], [e[3] for e in here])
                    found.update(zip((names[j] for j in columns), values, strict=True))
        for component, power, row, value in rows:
            left = value
            for name, factor in zip(names, row, strict=True):
                left = left - found[name] * factor
            if left.terms:
                raise ArithmeticError(
                    f"order {order}, component {component}, l^{power}: left over {left}"
                )
    return found


if __name__ == "__main__":
    for name, value in coefficients().items():
        print(f"{name} = {value}")
