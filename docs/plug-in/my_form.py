"""A form of one's own, on top of one of the catalogue. `docs/examples/own_form.py` writes one from nothing."""

from polhode.models.forms.quaternion import Quaternion


class MyQuaternion(Quaternion):
    """Replace `problem` (field, start, end, parameters) and `observe` (states to L, E, rotation) by your own."""

    name = "my-quaternion"
    summary = "the quaternion form under another name"
