"""Kinematics of a quaternion: what the forms with a quaternion in their state share."""

from collections.abc import Callable

import numpy as np

from polhode.models.operations import Operations


def directions(ops: Operations) -> Callable:
    """Flow and gradient directions in body axes, (t₁₁, t₂₁, t₃₁) and (t₁₂, t₂₂, t₃₂), of a quaternion of any norm.

    Divided by |q|², so that the norm, which solvers let drift, does not enter the torque. At loose tolerances over
    long runs this divides the errors by 10 to 100 and keeps runs from blowing up that otherwise do; a term that
    restores the norm does no better, costs a third more and bounds the step (paper's ellipsoid, St = 1e4 and 1e5).
    """

    def of(q0, q1, q2, q3):
        scale = 1 / (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
        double = 2 * scale
        flow = (
            scale * (q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3),
            double * (q1 * q2 - q0 * q3),
            double * (q1 * q3 + q0 * q2),
        )
        gradient = (
            double * (q1 * q2 + q0 * q3),
            scale * (q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3),
            double * (q2 * q3 - q0 * q1),
        )
        return flow, gradient

    return of


def quaternion_rates(ops: Operations) -> Callable:
    """q̇ = ½ q∘(0, ω), ω in body axes."""

    def of(q0, q1, q2, q3, w1, w2, w3):
        return (
            -0.5 * (q1 * w1 + q2 * w2 + q3 * w3),
            0.5 * (q0 * w1 + q2 * w3 - q3 * w2),
            0.5 * (q0 * w2 + q3 * w1 - q1 * w3),
            0.5 * (q0 * w3 + q1 * w2 - q2 * w1),
        )

    return of


def norm_drift(states: np.ndarray) -> np.ndarray:
    """|q|² - 1 of states, shape (n, d), that begin with a quaternion."""
    return np.sum(states[:, :4] ** 2, axis=1) - 1
