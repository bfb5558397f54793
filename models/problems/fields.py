"""Vector fields of the classical test problems; the numbers that belong to them stand in `problems.toml`."""

from polhode.models.operations import Field, Operations


def hires_field(ops: Operations) -> Field:
    def rhs(y, p):
        y1, y2, y3, y4, y5, y6, y7, y8 = y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7]
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

    return rhs


def robertson_field(ops: Operations) -> Field:
    def rhs(y, p):
        slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
        return back - slow, slow - back - fast, fast

    return rhs


def robertson_dae_field(ops: Operations) -> Field:
    def rhs(y, p):
        slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
        return back - slow, slow - back - fast, y[0] + y[1] + y[2] - 1.0

    return rhs


def oregonator_field(ops: Operations) -> Field:
    def rhs(y, p):
        y1, y2, y3 = y[0], y[1], y[2]
        return 77.27 * (y2 + y1 * (1 - 8.375e-6 * y1 - y2)), (y3 - (1 + y1) * y2) / 77.27, 0.161 * (y1 - y3)

    return rhs


def e5_field(ops: Operations) -> Field:
    """In units of 1.76e-3, 1e-9, 1e-11 and 1e-9, so that no component hides below an absolute tolerance."""

    def rhs(y, p):
        decay, meeting, back = 7.89e-10 * y[0], y[0] * y[2], y[1] * y[2]
        return (
            -decay - 1.1e-4 * meeting,
            1.76e6 * decay - 1.13e-2 * back,
            1.76e8 * decay - 19360.0 * meeting - 1.13 * back + 1.13e5 * y[3],
            193.6 * meeting - 1130.0 * y[3],
        )

    return rhs


def brusselator_field(ops: Operations) -> Field:
    def rhs(y, p):
        reaction = y[0] * y[0] * y[1]
        return 1 + reaction - 4 * y[0], 3 * y[0] - reaction

    return rhs


def van_der_pol_field(ops: Operations) -> Field:
    def rhs(y, p):
        return y[1], (1 - y[0] * y[0]) * y[1] - y[0]

    return rhs


def stiff_van_der_pol_field(ops: Operations) -> Field:
    def rhs(y, p):
        return y[1], 1e6 * ((1 - y[0] * y[0]) * y[1] - y[0])

    return rhs


def rigid_body_field(ops: Operations) -> Field:
    def rhs(y, p):
        return y[1] * y[2], -y[2] * y[0], -0.51 * y[0] * y[1]

    return rhs


def lorenz_field(ops: Operations) -> Field:
    def rhs(y, p):
        return 10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 * y[2] / 3

    return rhs


def oscillators_field(ops: Operations) -> Field:
    """Two oscillators, of frequencies 1 and 50, seen in coordinates that mix them."""

    def rhs(y, p):
        slow, fast = 0.5 * (y[0] + y[1]), 1250.0 * (y[0] - y[1])
        return y[2], y[3], -slow - fast, fast - slow

    return rhs


def attraction(ops: Operations):
    sqrt = ops.sqrt

    def pull(y, i):
        """Acceleration of star i by the others; star j has the mass j + 1."""
        ax, ay = 0.0 * y[0], 0.0 * y[0]
        for j in range(7):
            if j != i:
                dx, dy = y[j] - y[i], y[7 + j] - y[7 + i]
                square = dx * dx + dy * dy
                weight = (j + 1.0) / (square * sqrt(square))
                ax, ay = ax + weight * dx, ay + weight * dy
        return ax, ay

    return pull


def pleiades_field(ops: Operations) -> Field:
    pull = ops.use(attraction)

    def rhs(y, p):
        (x1, y1), (x2, y2), (x3, y3), (x4, y4) = pull(y, 0), pull(y, 1), pull(y, 2), pull(y, 3)
        (x5, y5), (x6, y6), (x7, y7) = pull(y, 4), pull(y, 5), pull(y, 6)
        return (
            y[14], y[15], y[16], y[17], y[18], y[19], y[20],
            y[21], y[22], y[23], y[24], y[25], y[26], y[27],
            x1, x2, x3, x4, x5, x6, x7,
            y1, y2, y3, y4, y5, y6, y7,
        )  # fmt: skip

    return rhs


def arenstorf_field(ops: Operations) -> Field:
    sqrt = ops.sqrt
    moon = 0.012277471
    earth = 1 - moon

    def rhs(y, p):
        x, z, u, w = y[0], y[1], y[2], y[3]
        near, far = x + moon, x - earth
        a, b = near * near + z * z, far * far + z * z
        a3, b3 = a * sqrt(a), b * sqrt(b)
        return u, w, x + 2 * w - earth * near / a3 - moon * far / b3, z - 2 * u - earth * z / a3 - moon * z / b3

    return rhs


def kepler_field(ops: Operations) -> Field:
    sqrt = ops.sqrt

    def rhs(y, p):
        square = y[0] * y[0] + y[1] * y[1]
        cube = square * sqrt(square)
        return y[2], y[3], -y[0] / cube, -y[1] / cube

    return rhs
