"""What the studies of averaging found, in sentences made of their numbers; none where nothing was measured."""

import tomllib
from collections.abc import Iterable, Sequence
from math import isnan
from pathlib import Path
from typing import Any

from polhode.harness.averaging import data
from polhode.harness.averaging.orders import LEAST_POINTS, Law, Slope, first_order, laws, slopes
from polhode.harness.averaging.second_order import COMPARED, TARGET
from polhode.harness.common.text import WORDING, in_two_digits
from polhode.models.second_order.form import SecondOrder

# Where the paper says that the averaged equations are good.
GOOD_FROM = {"spheroid": 1e2, "ellipsoid": 1e3}
# St at which second order is compared with first order.
GAIN_AT = 1e5
_SENTENCES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def _say(what: str, **fields: Any) -> str:
    return WORDING.vformat(_SENTENCES[what], (), fields)


def statements(rows: Sequence[data.AveragingErrors]) -> list[str]:
    """How good the paper's "good from St ≈ 100" is, and which orders hold."""
    own = laws(rows)
    first = [law for law in own if first_order(law.form)]
    second = [law for law in own if not first_order(law.form)]
    found = [_good(rows, first, family, stokes) for family, stokes in GOOD_FROM.items()]
    found += [_promise("First order", first, 1), _slower(rows)]
    for family, title in (("spheroid", "spheroids"), ("ellipsoid", "ellipsoids, no farther than L² = 2EI₂")):
        found.append(_promise(f"Second order, {title}", [law for law in second if law.family == family], 2))
    return [sentence for sentence in found if sentence]


def _good(rows: Sequence[data.AveragingErrors], first: Sequence[Law], family: str, stokes: float) -> str:
    there = [row for row in rows if row.family == family and row.stokes == stokes and first_order(row.form)]
    if not there:
        return ""
    best, worst = (pick(there, key=lambda row: row.model_error) for pick in (min, max))
    needed = [law.needed(1e-2)[0] for law in first if law.family == family]
    needed = [number for number in needed if not isnan(number)]
    met = f"from St ≈ {_span(needed)} on" if needed else "at none of the St measured"
    return _say("good", stokes=stokes, family=family, best=best, worst=worst, met=met)


def _promise(title: str, own: Sequence[Law], promised: int) -> str:
    """How the fitted orders compare with the order that averaging promises."""
    known = {law.subject: law for law in own if not isnan(law.order)}
    few = len(own) - len(known)
    if not known:
        return f"{title}: too few St for an order." if few else ""
    intervals = {name: _rounded(law) for name, law in known.items()}
    missed = [f"{name} ({a:.2f} to {b:.2f})" for name, (a, b) in intervals.items() if not a <= promised <= b]
    orders = [law.order for law in known.values()]
    counts = {"promised": promised, "known": len(known), "kept": len(known) - len(missed)}
    return _say(
        "promise",
        title=title,
        orders=(min(orders), max(orders)),
        missed=f", not in {' and '.join(missed)}" if missed else "",
        few=_say("few", few=few, points=LEAST_POINTS) if few else "",
        **counts,
    )


def _slower(rows: Sequence[data.AveragingErrors]) -> str:
    slower = [
        f"{name} of {law.subject} ({law.order:.2f})"
        for name in data.VARIABLES
        for law in laws(rows, name)
        if first_order(law.form) and _rounded(law)[1] < 1
    ]
    return _say("slower", slower=slower) if slower else ""


def _rounded(law: Law) -> tuple[float, float]:
    """The order's interval in the two decimals that are shown."""
    low, high = law.order_interval
    return round(low, 2), round(high, 2)


def findings(study: data.SecondOrderStudy) -> list[str]:
    """Orders, estimates, gains and cost of the second order."""
    fitted = slopes(study.orders)
    triaxial = [slope for slope in fitted if len(set(slope.shape.split(":"))) == 3]
    found = [
        _orders("Spheroids", [slope for slope in fitted if slope not in triaxial]),
        _orders("Triaxial ellipsoids away from resonances and from L² = 2EI₂", triaxial),
        _estimates("away from resonances", study.orders),
        _gains("Through resonances", study.resonances),
        _gains("Up to L² = 2EI₂", study.crossings),
        _estimates("there", [*study.resonances, *study.crossings]),
        _steady([each for each in study.cost if each.form == SecondOrder.name]),
        _compared([each for each in study.cost if each.stokes == COMPARED]),
    ]
    return [sentence for sentence in found if sentence]


def _orders(family: str, own: Sequence[Slope]) -> str:
    if not own:
        return ""
    slow, turned = ((min(values), max(values)) for values in zip(*((s.slow, s.orientation) for s in own), strict=True))
    return _say("orders", family=family, starts=len(own), slow=slow, turned=turned)


def _estimates(where: str, rows: Sequence[data.SecondOrderErrors] | Sequence[data.Passage]) -> str:
    own = [row for row in rows if not isnan(row.slow)]
    if not own:
        return ""
    slow = _span(row.estimated_slow / row.slow for row in own)
    turned = _span(row.estimated_orientation / row.orientation for row in own)
    return _say("estimates", where=where, slow=slow, turned=turned)


def _gains(where: str, rows: Sequence[data.Passage]) -> str:
    gains = [row.first_order_slow / row.slow for row in rows if row.stokes == GAIN_AT and not row.refused]
    if not gains:
        return ""
    counts = {"starts": len(gains), "refused": sum(bool(row.refused) for row in rows), "runs": len(rows)}
    return _say("gains", where=where, stokes=GAIN_AT, least=min(gains), most=max(gains), **counts)


def _steady(second: Sequence[data.Cost]) -> str:
    if not second:
        return ""
    times = [each.seconds for each in second]
    first, last = (pick(second, key=lambda each: each.stokes) for pick in (min, max))
    ratio = last.seconds / first.seconds
    return _say("steady", first=first, last=last, least=min(times), most=max(times), ratio=ratio)


def _compared(compared: Sequence[data.Cost]) -> str:
    own = [each for each in compared if each.form == SecondOrder.name]
    full = [each for each in compared if each.form == "spheroid-axis" and each.slow <= TARGET]
    if not (own and full):
        return ""
    best, counts = min(full, key=lambda each: each.seconds), {"stokes": COMPARED, "target": TARGET}
    ratio = best.seconds / own[0].seconds
    return _say("compared", best=best, own=own[0], solvers=len(full), ratio=ratio, **counts)


def _span(numbers: Iterable[float]) -> str:
    known = sorted(numbers)
    return f"{in_two_digits(known[0])} to {in_two_digits(known[-1])}"
