"""Quaternions of any norm, whose squares vanish or overflow, turn as those of norm 1 do."""

import numpy as np
import pytest

from polhode.models.rotation import matrix_from_quaternion


@pytest.mark.parametrize("size", [1e-300, 1e-160, 1e160, 1e300])
def test_the_norm_of_a_quaternion_does_not_matter(size: float):
    q = np.array([[0.5, -0.5, 0.1, 0.7], [1.0, 0.0, 0.0, 0.0]])
    expected = matrix_from_quaternion(q)
    assert matrix_from_quaternion(size * q) == pytest.approx(expected, abs=1e-15)


def test_a_quaternion_of_zeros_has_no_matrix_and_no_warning():
    assert np.isnan(matrix_from_quaternion(np.zeros((1, 4)))).all()
