"""Figures from their descriptions in the sections' files: panels with axes and curves, whose values are expressions."""

from collections.abc import Mapping
from itertools import cycle
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from polhode.harness.paper import drawing
from polhode.harness.paper.expressions import evaluated, worded
from polhode.harness.paper.tables import groups

# What a curve says beside its style.
CURVE = {"table", "by", "x", "y", "label", "slope", "level", "broken"}


def drawn(entry: Mapping[str, Any], names: dict[str, Any]) -> Figure:
    """The figure of an entry: its size, one table for each of its axes, and a legend below all if it has `columns`."""
    figure, axes = drawing.panels(*entry["panels"], **entry.get("options", {}))
    for own, panel in zip(axes, entry["axes"], strict=True):
        for curve in panel["curves"]:
            _draw(own, curve, names)
        title, log = worded(panel.get("title", ""), names), panel.get("log", "")
        drawing.label(own, panel["x"], panel["y"], title, log, **panel.get("limits", {}))
        for call in panel.get("also", ()):
            evaluated(call, {**names, "axes": own})
        if "legend" in panel:
            own.legend(**panel["legend"])
    if "columns" in entry:
        drawing.common_legend(figure, axes[0], entry["columns"])
    return figure


def _draw(axes: Axes, curve: Mapping[str, Any], names: dict[str, Any]) -> None:
    """Draw a curve of a table, or one for each value of a column `by`; x and y may name its columns, and `part`."""
    style = {key: value for key, value in curve.items() if key not in CURVE}
    style["color"] = getattr(drawing, style.get("color", ""), style.get("color"))
    table = evaluated(curve.get("table", "table"), names)
    key, text = curve.get("by"), curve.get("label")
    parts = groups(table, key) if key else [(None, table)]
    for color, (value, part) in zip(cycle(drawing.CYCLE), parts, strict=False):
        own = {**names, "part": part, **{name: part[name] for name in part.dtype.names}}
        chosen = {**style, "label": text}
        if key:
            own[key] = value
            chosen |= {"label": text and worded(text, own), "color": style["color"] or color}
        x, y, slope = (evaluated(curve.get(name), own) for name in ("x", "y", "slope"))
        if "slope" in curve:
            drawing.draw_law(axes, x, y, slope, **{name: each for name, each in chosen.items() if each is not None})
        elif "level" in curve:
            axes.axhline(evaluated(curve["level"], own), **chosen)
        elif "broken" in curve:
            drawing.draw_broken(axes, part, curve["x"], curve["y"], curve["broken"], **chosen)
        else:
            axes.plot(x, y, **chosen)
