"""Cost and error laws of methods, a form by a solver: what a run will take, and how far off it will be.

Cost of a warm run, in seconds, at tolerance tol and with m samples::

    fixed + per_sample m + tol^exponent (start + per_rotation N + per_time F) + per_damping_time S
    tol^stiff_exponent
        + per_piece P + per_entering E + per_row R

with N = ∫|ω|dt/2π the rotations, S = T max(8πX/I)/St the damping times, and F = TS/(T + S) the time
spent following the flow: the duration T, in inverse shear rates, where damping is faster than
shear, and next to none of it where the particle spins freely. N, F and S count by the steps that
they cost the form in the scene at hand, which pilot runs count (`polhode.harness.picking.load`). A
form that averages in P pieces of a run enters E of them with a triaxial body and maps R rows there;
tol is then that of its full equations. Explicit methods on stiff scenes are held back by stability:
damping times have an exponent of their own. Where trials count the steps, it is fixed + per_sample
m + per_step tol^step_exponent steps.

Error, in the pilot's terms (`polhode.harness.picking.pilot`), e₀ being the pilot's error at its
tolerance tol₀::

    10^offset (tol/tol₀)^order e₀^gain (1 + N)^growth (1 + S/T)^stiffness
        + floor eps largest (1 + N)^floor_growth

Each law knows how far measurements strayed from it on scenes that it was not fitted on.
"""

import json
import reprlib
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib.resources import files
from math import exp, inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from polhode.harness.answers.interval import Interval
from polhode.harness.common.files import read_file, write_file
from polhode.harness.common.timing import Pace
from polhode.models.files.kept import cache_folder

SCHEMA = 4
EPS = float(np.finfo(float).eps)
WANTS = ("slow", "orientation")
# Rotations from which on a run is long.
LONG = 500.0


@dataclass(frozen=True)
class Load:
    """What a run's cost depends on: N, F and S, counted by the form's own steps, samples, and P, E and R."""

    rotations: float
    following: float
    damping_times: float
    samples: int
    pieces: int = 0
    entered: int = 0
    rows: float = 0.0
    tolerance: float | None = None  # where it is not the one asked for
    steps: int | None = None  # where a trial counted them


@dataclass(frozen=True)
class Stray:
    """Quantiles 2.5, 50 and 97.5 % of ln(measured/predicted) on scenes left out of the fit."""

    low: float
    middle: float
    high: float

    def around(self, value: float) -> Interval:
        """The interval around a prediction."""
        return Interval(*(float(value * exp(each)) for each in (self.middle, self.low, self.high)))


@dataclass(frozen=True)
class CostLaw:
    """Seconds of a warm run; parameters as in the module's formula, `scale` being a machine's own factor."""

    fixed: float
    per_sample: float
    exponent: float
    start: float
    per_rotation: float
    per_time: float
    per_damping_time: float
    stiff_exponent: float
    stray: Stray
    records: int
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    scale: float = 1.0
    per_piece: float = 0.0
    per_entering: float = 0.0
    per_row: float = 0.0
    per_step: float = 0.0
    step_exponent: float = 0.0
    step_stray: Stray | None = None

    def seconds(self, load: Load, tolerance: float) -> float:
        """The prediction's middle before strays are known."""
        tolerance = load.tolerance or tolerance
        any_run = self.fixed + self.per_sample * load.samples
        if load.steps and self.step_stray:
            return self.scale * (
                any_run + self.per_step * tolerance**self.step_exponent * load.steps
            )
        work = self.start + self.per_rotation * load.rotations + self.per_time * load.following
        stiff = self.per_damping_time * load.damping_times * tolerance**self.stiff_exponent
        averaged = (
            self.per_piece * load.pieces
            + self.per_entering * load.entered
            + self.per_row * load.rows
        )
        return self.scale * (any_run + tolerance**self.exponent * work + stiff + averaged)

    def predict(self, load: Load, tolerance: float) -> Interval:
        """Seconds with their interval."""
        return ((load.steps and self.step_stray) or self.stray).around(
            self.seconds(load, tolerance)
        )


@dataclass(frozen=True)
class Sensitivity:
    """What the error of a run depends on, besides its tolerance."""

    tolerance: float  # tol₀ of the pilot
    error: float  # and e₀
    rotations: float
    stiffness: float  # S/T
    largest: float  # size of what is measured: the largest |L|, E over I_max, or 1 rad
    stiff: bool = False  # whether stability would hold an explicit method back

    @property
    def long(self) -> bool:
        """Whether there are more than `LONG` rotations."""
        return self.rotations > LONG


@dataclass(frozen=True)
class ErrorLaw:
    """Largest error along a run; parameters as in the module's formula."""

    offset: float
    order: float
    gain: float
    growth: float
    stiffness: float
    floor: float
    floor_growth: float
    stray: Stray
    records: int
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)

    def rounding(self, at: Sensitivity) -> float:
        """The floor: what no tolerance gets below."""
        return self.floor * EPS * at.largest * (1 + at.rotations) ** self.floor_growth

    def truncation(self, at: Sensitivity, tolerance: float) -> float:
        """What the tolerance governs."""
        own = 10**self.offset * (tolerance / at.tolerance) ** self.order * at.error**self.gain
        return own * (1 + at.rotations) ** self.growth * (1 + at.stiffness) ** self.stiffness

    def error(self, at: Sensitivity, tolerance: float) -> float:
        """The prediction's middle before strays are known."""
        return self.truncation(at, tolerance) + self.rounding(at)

    def predict(self, at: Sensitivity, tolerance: float) -> Interval:
        """Error with its interval."""
        return self.stray.around(self.error(at, tolerance))

    def tolerance(self, at: Sensitivity, error: float, stray: float | None = None) -> float:
        """Loosest tolerance at which 97.5 % of the runs meet an error, or those of a stray; 0 by none, inf by all."""
        allowed = error * exp(-(self.stray.high if stray is None else stray)) - self.rounding(at)
        if not (allowed > 0 and isfinite(at.error)):
            return 0.0
        at_pilot = self.truncation(at, at.tolerance)
        return at.tolerance * (allowed / at_pilot) ** (1 / self.order) if at_pilot > 0 else inf


@dataclass(frozen=True)
class MethodLaws:
    """All that is known of a method: its cost, and its error of each `regime`, if that was measured often enough."""

    form: str
    solver: str
    cost: CostLaw
    errors: dict[str, ErrorLaw]
    compile_seconds: (
        float  # what the first of all runs takes more: importing the library and compiling the form
    )
    tightest: float  # tolerance at which runs still ended well
    stale: bool = False  # whether form or solver have changed since

    def error_law(self, want: str, at: Sensitivity) -> ErrorLaw | None:
        """The law of what is wanted, in the scene's regime, or of shorter runs."""
        return self.errors.get(regime(want, at.stiff, at.long)) or self.errors.get(
            regime(want, at.stiff)
        )


def regime(want: str, stiff: bool, long: bool = False) -> str:
    """Name of the law of what is wanted."""
    # Where stability would hold explicit methods back errors die out; over long runs they have long
    # added up.
    return f"stiff {want}" if stiff else f"long {want}" if long else want


@dataclass(frozen=True)
class Laws:
    """Laws of all methods measured, by (form, solver); the source names machine, versions, and numbers of runs."""

    methods: dict[tuple[str, str], MethodLaws]
    source: dict[str, Any]

    @property
    def pace(self) -> Pace:
        """The pace that the times hold for."""
        return Pace(self.source.get("machine"), self.source.get("sentinel_seconds"))

    def save(self, path: Path) -> None:
        """Write as JSON, a line for each method."""
        lines = ",\n".join(_json(asdict(law)) for law in self.methods.values())
        head = f'"schema": {SCHEMA}, "source": {_json(self.source)}'
        write_file(path, f'{{{head}, "methods": [\n{lines}\n]}}\n', summed=True)


class OtherSchemaError(ValueError):
    """The laws are those of another version."""


def parse_laws(text: str) -> Laws:
    """Laws from JSON; raises OtherSchemaError if they are those of another version, ValueError if there are none."""
    content = json.loads(text)
    if not isinstance(content, dict):
        raise ValueError(f"got {reprlib.repr(content)}, expected a JSON object")
    if content.get("schema") != SCHEMA:
        raise OtherSchemaError(f"laws: got schema {content.get('schema')!r}, expected {SCHEMA}")
    try:
        methods = [_method(**row) for row in content["methods"]]
        return Laws({(law.form, law.solver): law for law in methods}, content["source"])
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"got no laws: {error!r}") from None


def _method(cost: dict[str, Any], errors: dict[str, dict[str, Any]], **rest: Any) -> MethodLaws:
    known = {name: _law(ErrorLaw, **each) for name, each in errors.items()}
    counted = cost.pop("step_stray", None)
    return MethodLaws(
        cost=_law(CostLaw, step_stray=counted and Stray(**counted), **cost), errors=known, **rest
    )


def _law(
    kind: type, stray: dict[str, float], intervals: dict[str, list[float]], **rest: Any
) -> Any:
    ends = {name: (low, high) for name, (low, high) in intervals.items()}
    return kind(stray=Stray(**stray), intervals=ends, **rest)


def own_laws_path() -> Path:
    """Where the laws fitted on the user's machine are kept."""
    return cache_folder() / "laws.json"


@cache
def load_laws() -> Laws:
    """Laws fitted on this machine by this version if there are any, else those that come with the package."""
    shipped = parse_laws(
        (files("polhode.harness.picking") / "laws.json").read_text(encoding="utf-8")
    )
    own = own_laws_path()
    try:
        found = read_laws(own) if own.is_file() else shipped
    except OtherSchemaError:
        return shipped
    except ValueError as error:
        raise ValueError(f"{error}; remove it to use those of the package") from None
    # Times of the package's laws scaled to this machine are of no use once there are other laws.
    same = all(
        found.source.get(each) == shipped.source.get(each)
        for each in ("scenes", "records", "added")
    )
    return found if same or "refitted" not in found.source else shipped


def read_laws(path: Path) -> Laws:
    """Laws of a file, if it is what was written; raises as `parse_laws` does."""
    try:
        return parse_laws(read_file(path).decode())
    except ValueError as error:
        raise (
            error
            if isinstance(error, OtherSchemaError)
            else ValueError(f"{path}: {error}, expected laws")
        ) from None


def _json(content: Any) -> str:
    """JSON with numbers at six digits: more would be noise."""
    return json.dumps(
        json.loads(json.dumps(content), parse_float=lambda digits: float(f"{float(digits):.6g}"))
    )
