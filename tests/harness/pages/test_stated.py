"""The page of stated errors."""

from polhode.harness.pages.stated import reasons


def test_refusals_that_differ_by_their_scene_are_counted_together():
    refusals = [
        "the semi-axes [0.2, 1.0, 0.3] are all different",
        "the semi-axes [0.6, 0.5, 1.0] are all different",
        "averaging does not hold from t₂ = 7.9e-05: L² = 2EI₂",
        "averaging does not hold from t₂ = 0.047: L² = 2EI₂",
        "averaging does not hold from t₂ = 0.5: L² = 2EI₂",
        "time: got 9.04162e+07, expected at most 5e+07 above St = 1e6",
    ]
    assert reasons(refusals) == (
        "3 × averaging does not hold from t₂ = …: L² = 2EI₂; "
        "2 × the semi-axes … are all different; "
        "1 × time: got …, expected at most 5e+07 above St = 1e6"
    )
