# SPDX-License-Identifier: BSD-2-Clause
"""Numbers, shares, times and tables as a report's page writes them: texts in HTML."""

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np


def number_text(value: float | None, unit: str = "", digits: int = 3) -> str:
    """A number as people write it; a dash for none."""
    if value is None or not np.isfinite(value):
        return "–"
    text = f"{value:.{digits}g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        text = f"{mantissa}·10<sup>{int(exponent)}</sup>"
    return text.replace("-", "−") + (f"&nbsp;{escape(unit)}" if unit else "")


def percent_text(share: float) -> str:
    """A share as people write it."""
    if 0.0 < share < 0.001:
        return "&lt;&nbsp;0.1&nbsp;%"
    return f"{100.0 * share:.1f}&nbsp;%"


def time_button(time: float | None) -> str:
    """A time that one can go to."""
    if time is None:
        return "–"
    return f'<button type="button" class="time" data-time="{time!r}">{time:.2f}&nbsp;s</button>'


def table(titles: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "") -> str:
    """A table of cells that are HTML already; the first of each row is its head."""
    head = "".join(f'<th scope="col">{title}</th>' for title in titles)
    body = "".join(
        f'<tr><th scope="row">{first}</th>' + "".join(f"<td>{cell}</td>" for cell in rest) + "</tr>"
        for first, *rest in rows
    )
    return f'<table class="{kind}"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
