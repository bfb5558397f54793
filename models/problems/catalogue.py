"""The test problems by name, those of plug-ins too."""

from polhode.models.problems.celestial import CELESTIAL
from polhode.models.problems.classical import Classical
from polhode.models.problems.kinetics import KINETICS
from polhode.models.problems.oscillators import OSCILLATORS
from polhode.models.registry import imported, plug_ins

PROBLEMS: dict[str, Classical] = KINETICS | OSCILLATORS | CELESTIAL
for _name, _target in plug_ins("problems").items():
    PROBLEMS.setdefault(_name, imported(_target))
