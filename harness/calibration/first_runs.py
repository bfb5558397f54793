"""First runs of all methods, measured anew without fitting the laws."""

from contextlib import suppress
from dataclasses import replace

from polhode.harness.common.machine import machine
from polhode.harness.picking.laws import Laws
from polhode.harness.studies.cost import first_seconds
from polhode.models.catalogue import form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.scene import Scene
from polhode.models.scenes import SCENES


def with_first_runs(laws: Laws) -> Laws:
    """The same laws with this machine's first runs, each form's on the first built-in scene that it takes.

    Where such a run fails, what was known before stays.
    """
    examples = {form: scene for form, _ in laws.methods if (scene := _example(form))}
    seconds = first_seconds(examples, [method for method in laws.methods if method[0] in examples])
    methods = {
        method: replace(law, compile_seconds=seconds.get(method) or law.compile_seconds)
        for method, law in laws.methods.items()
    }
    return Laws(methods, laws.source | {"first_runs": machine()})


def _example(form: str) -> Scene | None:
    for each in SCENES.values():
        with suppress(FormNotValidError):
            find_form(form).check(each.scene)
            return each.scene
    return None
