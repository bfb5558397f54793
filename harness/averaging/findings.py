"""What the study of second-order averaging found, in sentences made of its numbers."""

from collections.abc import Sequence
from math import isnan

from polhode.harness.averaging.cases import SAMPLES
from polhode.harness.averaging.cost import COMPARED, TARGET, Cost
from polhode.harness.averaging.resonances import ResonantRow
from polhode.harness.averaging.second_orders import Row, Slope
from polhode.harness.common.text import duration, in_two_digits, scientific, short
from polhode.models.second_order.form import SecondOrder

# Which shapes orders are told of, and whether those are triaxial.
FAMILIES = (("Spheroids", False), ("Triaxial ellipsoids away from resonances and from L² = 2EI₂", True))
# St at which gains over first order are told.
GAIN_AT = 1e5


def findings(
    rows: Sequence[Row],
    fitted: Sequence[Slope],
    resonances: Sequence[ResonantRow],
    crossings: Sequence[ResonantRow],
    cost: Sequence[Cost],
) -> list[str]:
    """One sentence per question that the study asks; none where nothing was measured."""
    found = [
        *(_orders(family, [s for s in fitted if _triaxial(s.shape) == triaxial]) for family, triaxial in FAMILIES),
        _estimates("away from resonances", rows),
        _gains("Through resonances", resonances),
        _gains("Up to L² = 2EI₂", crossings),
        _estimates("there", [*resonances, *crossings]),
        _share([*resonances, *crossings]),
        _steady([each for each in cost if each.form == SecondOrder.name]),
        _compared([each for each in cost if each.stokes == COMPARED]),
    ]
    return [sentence for sentence in found if sentence]


def _triaxial(shape: str) -> bool:
    return len(set(shape.split(":"))) == 3


def _orders(family: str, own: Sequence[Slope]) -> str:
    if not own:
        return ""
    slow, turned = (sorted(values) for values in ([s.slow for s in own], [s.orientation for s in own]))
    return (
        f"{family}, {len(own)} starts: the slow error falls like St^{slow[-1]:.2f} to St^{slow[0]:.2f}, where second "
        f"order promises St^-2, and the orientation's like St^{turned[-1]:.2f} to St^{turned[0]:.2f}, where it "
        "promises St^-1."
    )


def _estimates(where: str, rows: Sequence[Row] | Sequence[ResonantRow]) -> str:
    own = [row for row in rows if not isnan(row.slow)]
    if not own:
        return ""
    slow = sorted(row.estimated_slow / row.slow for row in own)
    turned = sorted(row.estimated_orientation / row.orientation for row in own)
    return (
        f"What the form estimates beforehand, {where}: {_span(slow)} times the slow error measured, {_span(turned)} "
        "times the orientation's."
    )


def _span(ordered: Sequence[float]) -> str:
    return " to ".join(in_two_digits(value) for value in (ordered[0], ordered[-1]))


def _gains(where: str, rows: Sequence[ResonantRow]) -> str:
    gains = sorted(row.first_order_slow / row.slow for row in rows if row.stokes == GAIN_AT and not row.refused)
    if not gains:
        return ""
    refused = sum(1 for row in rows if row.refused)
    return (
        f"{where}, at St = {short(GAIN_AT)}: a slow error {gains[0]:.0f} to {gains[-1]:.0f} times smaller than first "
        f"order's ({len(gains)} starts). Refused at all St: {refused} of {len(rows)} runs."
    )


def _share(rows: Sequence[ResonantRow]) -> str:
    shares = sorted(row.integration / row.seconds for row in rows if row.integration > 0)
    if not shares:
        return ""
    return (
        f"Of the time of these runs the integration takes {_span([100 * share for share in shares])} %; the rest "
        f"goes into the observables at {SAMPLES} times."
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
