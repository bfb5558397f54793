"""Rates of the classical test problems, over numbers of any kind.

Starts, ends, published solutions and sources stand in `problems.toml`. The numbers in the rates are
the sources' own, in the sources' units; the units of E5 alone are others. Each function is a
factory: from the operations on a kind of number it makes the rates y' of a state y. The parameters
p are empty, but every field takes them.
"""

from collections.abc import Callable

from polhode.models.operations import Field, Operations


def hires(ops: Operations) -> Field:
    """HIRES, 8 components: concentrations in a plant's response to light of high irradiance."""

    def rates(y, p):
        y1, y2, y3, y4, y5, y6, y7, y8 = y
        bound = 280 * y6 * y8
        return (
            -1.71 * y1 + 0.43 * y2 + 8.32 * y3 + 0.0007,
            1.71 * y1 - 8.75 * y2,
            -10.03 * y3 + 0.43 * y4 + 0.035 * y5,
            8.32 * y2 + 1.71 * y3 - 1.12 * y4,
            -1.745 * y5 + 0.43 * y6 + 0.43 * y7,
            -bound + 0.69 * y4 + 1.71 * y5 - 0.43 * y6 + 0.69 * y7,
            bound - 1.81 * y7,
            -bound + 1.81 * y7,
        )

    return rates


def pollution(ops: Operations) -> Field:
    """POLLU, 20 components: concentrations in polluted air.

    r1 to r25 are the speeds of its 25 reactions. No speed depends on y8, y12, y15 or y18.
    """

    def rates(y, p):
        y1 = y[0]
        y2 = y[1]
        y3 = y[2]
        y4 = y[3]
        y5 = y[4]
        y6 = y[5]
        y7 = y[6]
        y9 = y[8]
        y10 = y[9]
        y11 = y[10]
        y13 = y[12]
        y14 = y[13]
        y16 = y[15]
        y17 = y[16]
        y19 = y[18]
        y20 = y[19]
        r1 = 0.35 * y1
        r2 = 26.6 * y2 * y4
        r3 = 12300.0 * y5 * y2
        r4 = 0.00086 * y7
        r5 = 0.00082 * y7
        r6 = 15000.0 * y7 * y6
        r7 = 0.00013 * y9
        r8 = 24000.0 * y9 * y6
        r9 = 16500.0 * y11 * y2
        r10 = 9000.0 * y11 * y1
        r11 = 0.022 * y13
        r12 = 12000.0 * y10 * y2
        r13 = 1.88 * y14
        r14 = 16300.0 * y1 * y6
        r15 = 4800000.0 * y3
        r16 = 0.00035 * y4
        r17 = 0.0175 * y4
        r18 = 100000000.0 * y16
        r19 = 444000000000.0 * y16
        r20 = 1240.0 * y17 * y6
        r21 = 2.1 * y19
        r22 = 5.78 * y19
        r23 = 0.0474 * y1 * y4
        r24 = 1780.0 * y19 * y1
        r25 = 3.12 * y20
        return (
            -r1 + r2 + r3 + r9 - r10 + r11 + r12 - r14 + r22 - r23 - r24 + r25,
            r1 - r2 - r3 - r9 - r12 + r21,
            r1 - r15 + r17 + r19 + r22,
            -r2 + r15 - r16 - r17 - r23,
            -r3 + 2 * r4 + r6 + r7 + r13 + r20,
            r3 - r6 - r8 - r14 + 2 * r18 - r20,
            -r4 - r5 - r6 + r13,
            r4 + r5 + r6 + r7,
            -r7 - r8,
            r7 + r9 - r12,
            r8 - r9 - r10 + r11,
            r9,
            r10 - r11,
            r12 - r13,
            r14,
            r16 - r18 - r19,
            -r20,
            r20,
            -r21 - r22 + r23 - r24 + r25,
            r24 - r25,
        )

    return rates


def _robertson_reactions(y):
    """Speeds of the three reactions of Robertson's problem."""
    y1, y2, y3 = y
    return 0.04 * y1, 1e4 * y2 * y3, 3e7 * y2 * y2


def robertson(ops: Operations) -> Field:
    """Robertson, 3 components: the shares of three species in an autocatalytic reaction."""

    def rates(y, p):
        slow, back, fast = _robertson_reactions(y)
        return (back - slow, slow - back - fast, fast)

    return rates


def robertson_dae(ops: Operations) -> Field:
    """Robertson as a DAE: the third equation, of mass 0, is 0 = y1 + y2 + y3 - 1."""

    def rates(y, p):
        slow, back, fast = _robertson_reactions(y)
        return (back - slow, slow - back - fast, y[0] + y[1] + y[2] - 1.0)

    return rates


def oregonator(ops: Operations) -> Field:
    """OREGO, the Oregonator, 3 components: the oscillating reaction of Belousov and Zhabotinsky."""

    def rates(y, p):
        y1, y2, y3 = y
        return (
            77.27 * (y2 + y1 * (1 - 8.375e-6 * y1 - y2)),
            (y3 - (1 + y1) * y2) / 77.27,
            0.161 * (y1 - y3),
        )

    return rates


def e5(ops: Operations) -> Field:
    """E5, 4 components: concentrations in a pyrolysis, in the units that `problems.toml` names."""

    def rates(y, p):
        y1, y2, y3, y4 = y
        decay = 7.89e-10 * y1
        meeting = y1 * y3
        back = y2 * y3
        return (
            -decay - 1.1e-4 * meeting,
            1.76e6 * decay - 1.13e-2 * back,
            1.76e8 * decay - 19360.0 * meeting - 1.13 * back + 1.13e5 * y4,
            193.6 * meeting - 1130.0 * y4,
        )

    return rates


def brusselator(ops: Operations) -> Field:
    """Brusselator, 2 components: an autocatalytic reaction with A = 1 and B = 3."""

    def rates(y, p):
        y1, y2 = y
        reaction = y1 * y1 * y2
        return (1 + reaction - 4 * y1, 3 * y1 - reaction)

    return rates


def van_der_pol(ops: Operations) -> Field:
    """van der Pol, 2 components: an oscillator with mu = 1, in position and velocity."""

    def rates(y, p):
        y1, y2 = y
        return (y2, (1 - y1 * y1) * y2 - y1)

    return rates


def stiff_van_der_pol(ops: Operations) -> Field:
    """stiff van der Pol, 2 components: epsilon y2' = (1 - y1²) y2 - y1 with epsilon = 1e-6."""

    def rates(y, p):
        y1, y2 = y
        return (y2, 1e6 * ((1 - y1 * y1) * y2 - y1))

    return rates


def oscillators(ops: Operations) -> Field:
    """oscillators, 4 components: y1 + y2 has the frequency 1, y1 - y2 has sqrt(2500) = 50."""

    def rates(y, p):
        y1, y2, y3, y4 = y
        slow = 0.5 * (y1 + y2)
        fast = 1250.0 * (y1 - y2)
        return (y3, y4, -slow - fast, fast - slow)

    return rates


def lorenz(ops: Operations) -> Field:
    """Lorenz, 3 components: convection with sigma = 10, r = 28 and b = 8/3."""

    def rates(y, p):
        y1, y2, y3 = y
        return (10 * (y2 - y1), y1 * (28 - y3) - y2, y1 * y2 - 8 * y3 / 3)

    return rates


def rigid_body(ops: Operations) -> Field:
    """rigid body, 3 components: Jacobi's elliptic functions sn, cn and dn, with k² = 0.51."""

    def rates(y, p):
        y1, y2, y3 = y
        return (y2 * y3, -y3 * y1, -0.51 * y1 * y2)

    return rates


def pleiades(ops: Operations) -> Field:
    """Pleiades, 28 components: seven stars in a plane.

    First come all x, then all y, then all velocities in x and all in y. The stars are numbered from
    0; star j has the mass j + 1, and the constant of gravity is 1.
    """
    stars = range(7)

    def rates(y, p):
        pairs = [(i, j) for i in stars for j in stars if j != i]
        square = {}
        for i, j in pairs:
            square_in_x = (y[j] - y[i]) * (y[j] - y[i])
            square_in_y = (y[7 + j] - y[7 + i]) * (y[7 + j] - y[7 + i])
            square[i, j] = square_in_x + square_in_y
        # The mass of star j over the cube of its distance from star i.
        weight = {}
        for i, j in pairs:
            weight[i, j] = (j + 1.0) / (square[i, j] * ops.sqrt(square[i, j]))

        # `first` is the index of the first x, 0, or of the first y, 7.
        def acceleration(i, first):
            # A zero of the kind of number that y has.
            total = 0.0 * y[0]
            for j in stars:
                if j != i:
                    total = total + weight[i, j] * (y[first + j] - y[first + i])
            return total

        return (
            *y[14:],
            *(acceleration(i, 0) for i in stars),
            *(acceleration(i, 7) for i in stars),
        )

    return rates


def arenstorf(ops: Operations) -> Field:
    """Arenstorf, 4 components: a satellite near Earth and Moon, in the frame that turns with them.

    Units are the distance of Earth and Moon, the sum of their masses, and their period over 2π. The
    state has x, y and their rates; Earth lies at x = -moon, the Moon at x = earth.
    """

    def rates(y, p):
        y1, y2, y3, y4 = y
        # Masses of Moon and Earth.
        moon = 0.012277471
        earth = 1 - moon
        # Distances in x from Earth and from the Moon.
        near = y1 + moon
        far = y1 - earth
        # Squares of the distances from Earth and from the Moon, then their cubes.
        a = near * near + y2 * y2
        b = far * far + y2 * y2
        a3 = a * ops.sqrt(a)
        b3 = b * ops.sqrt(b)
        return (
            y3,
            y4,
            y1 + 2 * y4 - earth * near / a3 - moon * far / b3,
            y2 - 2 * y3 - earth * y2 / a3 - moon * y2 / b3,
        )

    return rates


def kepler(ops: Operations) -> Field:
    """Kepler, 4 components: a planet's x, y and their rates about a sun at 0, with GM = 1."""

    def rates(y, p):
        y1, y2, y3, y4 = y
        square = y1 * y1 + y2 * y2
        cube = square * ops.sqrt(square)
        return (y3, y4, -y1 / cube, -y2 / cube)

    return rates


# The factories by the names of the problems in `problems.toml`.
FIELDS: dict[str, Callable[[Operations], Field]] = {
    "hires": hires,
    "pollution": pollution,
    "robertson": robertson,
    "robertson-dae": robertson_dae,
    "oregonator": oregonator,
    "e5": e5,
    "brusselator": brusselator,
    "van-der-pol": van_der_pol,
    "stiff-van-der-pol": stiff_van_der_pol,
    "oscillators": oscillators,
    "lorenz": lorenz,
    "rigid-body": rigid_body,
    "pleiades": pleiades,
    "arenstorf": arenstorf,
    "kepler": kepler,
}
