"""NumPy's long double on this machine: its kind and precision."""

import numpy as np

# Bits of the fraction of x86's long double.
_X86_MANTISSA = 63
# Whether it is x86's of 80 bits. Elsewhere it is no wider than double, or IEEE's quadruple one.
IS_X86 = np.finfo(np.longdouble).nmant == _X86_MANTISSA
