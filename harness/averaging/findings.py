"""What the studies of averaging found, in sentences made of their numbers; none where nothing was measured."""

from collections.abc import Iterable, Sequence
from math import isnan

from polhode.harness.averaging.data import (
    VARIABLES,
    AveragingErrors,
    Cost,
    Passage,
    SecondOrderErrors,
    SecondOrderStudy,
)
from polhode.harness.averaging.orders import LEAST_POINTS, Law, Slope, first_order, laws, slopes
from polhode.harness.averaging.second_order import COMPARED, TARGET
from polhode.harness.common.text import duration, in_two_digits, scientific, short
from polhode.models.second_order.form import SecondOrder

# Where the paper says that the averaged equations are good.
GOOD_FROM = {"spheroid": 1e2, "ellipsoid": 1e3}
# St at which second order is compared with first order.
GAIN_AT = 1e5


def statements(rows: Sequence[AveragingErrors]) -> list[str]:
    """How good the paper's "good from St ≈ 100" is, and which orders hold."""
    own = laws(rows)
    first = [law for law in own if first_order(law.form)]
    second = [law for law in own if not first_order(law.form)]
    found = [_good(rows, first, family, stokes) for family, stokes in GOOD_FROM.items()]
    found += [_promise("First order", first, 1), _slower(rows)]
    for family, title in (("spheroid", "spheroids"), ("ellipsoid", "ellipsoids, no farther than L² = 2EI₂")):
        found.append(_promise(f"Second order, {title}", [law for law in second if law.family == family], 2))
    return [sentence for sentence in found if sentence]


def _good(rows: Sequence[AveragingErrors], first: Sequence[Law], family: str, stokes: float) -> str:
    there = [row for row in rows if row.family == family and row.stokes == stokes and first_order(row.form)]
    if not there:
        return ""
    best, worst = (pick(there, key=lambda row: row.model_error) for pick in (min, max))
    needed = [law.needed(1e-2)[0] for law in first if law.family == family]
    needed = sorted(number for number in needed if not isnan(number))
    if needed:
        met = f"an error of 1 % is met from St ≈ {_span(needed)} on"
    else:
        met = "an error of 1 % is met at none of the St measured"
    return (
        f'The paper\'s "good from St ≈ {stokes:g} for the {family}" means, at that St, a slow error between '
        f"{best.model_error:.2g} ({best.subject}) and {worst.model_error:.2g} ({worst.subject}); {met}, depending on "
        "the case."
    )


def _promise(title: str, own: Sequence[Law], promised: int) -> str:
    """How the fitted orders compare with the order that averaging promises."""
    known = [law for law in own if not isnan(law.order)]
    few = len(own) - len(known)
    if not known:
        return f"{title}: too few St for an order." if few else ""
    orders = sorted(law.order for law in known)
    intervals = {law.subject: _rounded(law) for law in known}
    missed = [
        f"{name} ({low:.2f} to {high:.2f})" for name, (low, high) in intervals.items() if not low <= promised <= high
    ]
    return (
        f"{title}: the slow error falls like 1/St^p, p fitted between {orders[0]:.2f} and {orders[-1]:.2f}. Averaging "
        f"promises p = {promised}, which lies in the 95 % interval of p in {len(known) - len(missed)} of {len(known)} "
        "cases"
        + (f", not in {' and '.join(missed)}" if missed else "")
        + (f". In {few} more there are fewer than {LEAST_POINTS} St to fit." if few else ".")
    )


def _slower(rows: Sequence[AveragingErrors]) -> str:
    slower = [
        f"{name} of {law.subject} ({law.order:.2f})"
        for name in VARIABLES
        for law in laws(rows, name)
        if first_order(law.form) and _rounded(law)[1] < 1
    ]
    if not slower:
        return ""
    return (
        "In single variables first order falls more slowly than 1/St, the whole interval of p lying below 1: "
        + ", ".join(slower)
        + ". The paper allows for that where the motion passes transient resonances."
    )


def _rounded(law: Law) -> tuple[float, float]:
    """The order's interval in the two decimals that are shown."""
    low, high = law.order_interval
    return round(low, 2), round(high, 2)


def findings(study: SecondOrderStudy) -> list[str]:
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
    slow, turned = (sorted(values) for values in ([s.slow for s in own], [s.orientation for s in own]))
    return (
        f"{family}, {len(own)} starts: the slow error falls like St^{slow[-1]:.2f} to St^{slow[0]:.2f}, where second "
        f"order promises St^-2, and the orientation's like St^{turned[-1]:.2f} to St^{turned[0]:.2f}, where it "
        "promises St^-1."
    )


def _estimates(where: str, rows: Sequence[SecondOrderErrors] | Sequence[Passage]) -> str:
    own = [row for row in rows if not isnan(row.slow)]
    if not own:
        return ""
    slow = _span(row.estimated_slow / row.slow for row in own)
    turned = _span(row.estimated_orientation / row.orientation for row in own)
    return (
        f"What the form estimates beforehand, {where}: {slow} times the slow error measured, {turned} times the "
        "orientation's."
    )


def _gains(where: str, rows: Sequence[Passage]) -> str:
    gains = sorted(row.first_order_slow / row.slow for row in rows if row.stokes == GAIN_AT and not row.refused)
    if not gains:
        return ""
    refused = sum(1 for row in rows if row.refused)
    return (
        f"{where}, at St = {short(GAIN_AT)}: a slow error {gains[0]:.0f} to {gains[-1]:.0f} times smaller than first "
        f"order's ({len(gains)} starts). Refused at all St: {refused} of {len(rows)} runs."
    )


def _steady(second: Sequence[Cost]) -> str:
    if not second:
        return ""
    times = sorted(each.seconds for each in second)
    first, last = (pick(second, key=lambda each: each.stokes) for pick in (min, max))
    return (
        f"A run of a spheroid with {first.samples} output times costs {duration(times[0])} to {duration(times[-1])} at "
        f"St from {short(first.stokes)} to {short(last.stokes)}: at the largest St {last.seconds / first.seconds:.2f} "
        "times what it costs at the smallest."
    )


def _compared(compared: Sequence[Cost]) -> str:
    own = [each for each in compared if each.form == SecondOrder.name]
    full = [each for each in compared if each.form == "spheroid-axis" and each.slow <= TARGET]
    if not (own and full):
        return ""
    best = min(full, key=lambda each: each.seconds)
    return (
        f"At St = {short(COMPARED)} the full equations take {duration(best.seconds)} for a slow error of at most "
        f"{short(TARGET)} (`{best.solver}`, the fastest of {len(full)} solvers), {best.seconds / own[0].seconds:.0f} "
        f"times as long as second order, whose error is {scientific(own[0].slow)}."
    )


def _span(numbers: Iterable[float]) -> str:
    known = sorted(numbers)
    return f"{in_two_digits(known[0])} to {in_two_digits(known[-1])}"
