"""The parts of an HTML page that stands alone: tables, pictures, charts, and the style of the whole."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from capture.errors import BonetrackError
from capture.own import HTML_META

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


class ReportError(BonetrackError):
    """A report cannot be written."""


def page(title: str, lead: str, sections: Sequence[tuple[str, str]]) -> str:
    """A whole page: title, a line below it, and sections of (heading, HTML)."""
    links = " ".join(f"<a href='#{_anchor(name)}'>{escape(name)}</a>" for name, _ in sections)
    body = "\n".join(
        f"<section id='{_anchor(name)}'>\n<h2>{escape(name)}</h2>\n{content}\n</section>" for name, content in sections
    )
    return (
        "<!doctype html>\n<html lang='en'>\n<head>\n"
        f"{HTML_META}\n<meta charset='utf-8'>\n"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>\n"
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n<script>{_plotly_js()}</script>\n</head>\n<body>\n"
        f"<header><h1>{escape(title)}</h1>\n<p>{lead}</p>\n<nav aria-label='Sections'>{links}</nav></header>\n"
        f"<main>\n{body}\n</main>\n<script>{_FOR_PRINT}</script>\n</body>\n</html>\n"
    )


def table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; the first column heads its rows, the others are numbers or words as they are.

    >>> print(table("Sides", ["limb", "side"], [["arm & hand", "right"]]))
    <div class='scroll'><table>
    <caption>Sides</caption>
    <thead><tr><th scope='col'>limb</th><th scope='col'>side</th></tr></thead>
    <tbody>
    <tr><th scope='row'>arm &amp; hand</th><td>right</td></tr>
    </tbody>
    </table></div>
    """
    top = "".join(f"<th scope='col'>{escape(cell)}</th>" for cell in head)
    lines = []
    for first, *rest in rows:
        cells = "".join(f"<td>{escape(cell)}</td>" for cell in rest)
        lines.append(f"<tr><th scope='row'>{escape(first)}</th>{cells}</tr>")
    body = "\n".join(lines)
    return (
        f"<div class='scroll'><table>\n<caption>{escape(caption)}</caption>\n"
        f"<thead><tr>{top}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table></div>"
    )


def chart(figure: Figure, about: str) -> str:
    """A chart that people can zoom into, with what it shows in words for those who do not see it."""
    config = {"displaylogo": False, "responsive": True, "plotlyServerURL": "", "displayModeBar": False}
    drawing = figure.to_html(full_html=False, include_plotlyjs=False, config=config)
    return f"<figure role='img' aria-label='{escape(about, quote=True)}'>{drawing}</figure>"


def picture(image: NDArray[np.uint8], alt: str) -> str:
    """An image (H, W, 3) inside the page.

    >>> picture(np.zeros((2, 2, 3), dtype=np.uint8), "nothing")[:40]
    "<figure><img src='data:image/png;base64,"
    """
    import cv2

    _, encoded = cv2.imencode(".png", image[:, :, ::-1])
    data = base64.b64encode(encoded.tobytes()).decode("ascii")
    words = escape(alt, quote=True)
    return f"<figure><img src='data:image/png;base64,{data}' alt='{words}'><figcaption>{words}</figcaption></figure>"


def paragraph(text: str) -> str:
    """Plain words.

    >>> paragraph("a < b")
    '<p>a &lt; b</p>'
    """
    return f"<p>{escape(text)}</p>"


def bullets(items: Sequence[str]) -> str:
    """A list of plain words.

    >>> bullets(["one", "two & three"])
    '<ul><li>one</li><li>two &amp; three</li></ul>'
    """
    return f"<ul>{''.join(f'<li>{escape(item)}</li>' for item in items)}</ul>"


def _anchor(name: str) -> str:
    return "-".join("".join(c if c.isalnum() else " " for c in name.lower()).split())


def refuse_without_plotly() -> None:
    """Tell before the work, not after it.

    Raises:
        ReportError: plotly is not installed.
    """
    try:
        import plotly.subplots  # noqa: F401
    except ImportError as error:
        raise ReportError("the report needs plotly", remedy="pip install 'bonetrack[view]'") from error


def _plotly_js() -> str:
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())


_STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0; font: 15px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
body { color: #222; background: #fff; }
header, main { max-width: 62rem; margin: 0 auto; padding: 0 1.5rem; }
header { padding-top: 2rem; border-bottom: 1px solid #ddd; }
h1 { font-size: 1.6rem; margin: 0 0 0.3rem; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 0.6rem; }
nav { margin: 0.8rem 0 1rem; font-size: 0.9rem; }
nav a { color: #1f5fa8; margin-right: 1.1rem; white-space: nowrap; }
p { max-width: 46rem; }
li { max-width: 46rem; }
figure { margin: 0.8rem 0; }
figure img { max-width: 100%; height: auto; }
figcaption, caption { font-size: 0.85rem; color: #555; text-align: left; padding: 0.3rem 0; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; margin: 0.8rem 0; font-variant-numeric: tabular-nums; font-size: 0.92rem; }
th, td { padding: 0.28rem 0.9rem 0.28rem 0; text-align: right; border-bottom: 1px solid #e6e6e6; vertical-align: top; }
thead th { border-bottom: 1px solid #999; font-weight: 600; }
tbody th { font-weight: 400; }
th:first-child { text-align: left; }
main { padding-bottom: 3rem; }
@media print {
  nav, .modebar { display: none !important; }
  header, main { max-width: none; padding: 0; }
  body { font-size: 10.5pt; }
  h2 { break-after: avoid; }
  table, figure { break-inside: avoid; }
}
"""
_PRINT_PX = 680  # what an A4 page has between its margins
_FOR_PRINT = f"""
const charts = () => document.querySelectorAll('.plotly-graph-div');
window.addEventListener('beforeprint', () => charts().forEach(c => Plotly.relayout(c, {{width: {_PRINT_PX}}})));
window.addEventListener('afterprint', () => charts().forEach(c => Plotly.relayout(c, {{width: null, autosize: true}})));
"""
