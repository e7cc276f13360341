"""A report as one HTML page that needs no network, as Markdown, and its tables as LaTeX."""

import base64
import html
import os
from pathlib import Path
from urllib.parse import quote

import pandas as pd

from rss_shield.eval.files import write_text
from rss_shield.eval.paper.section import Section
from rss_shield.eval.runs.tables import markdown_of

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; max-width: 70rem; margin: 2rem auto;
  padding: 0 1rem; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 2.5rem; border-bottom: 2px solid #0072b2; padding-bottom: .2rem; }
nav a { margin-right: 1rem; } a { color: #0072b2; }
.scroll { overflow-x: auto; } .scroll { margin: 1.5rem 0; } table { border-collapse: collapse; font-size: .82rem; }
td small { display: block; color: #555; }
th, td { padding: .25rem .6rem; text-align: right; border-bottom: 1px solid #ddd; white-space: nowrap; }
td:first-child, th:first-child { text-align: left; } thead th { border-bottom: 2px solid #555; white-space: normal; }
tbody tr:nth-child(even) { background: #f6f8fa; }
figure { margin: 1.5rem 0; } figure img { max-width: min(100%, 54rem); height: auto; }
figcaption, caption { color: #444;
  font-size: .85rem; text-align: left; } caption { caption-side: bottom; padding-top: .3rem; }
pre { background: #f6f8fa; padding: .6rem; font-size: .85rem; white-space: pre-wrap; overflow-wrap: anywhere; }
@media print { body { max-width: none; margin: 0; font-size: 11px; } h2 { break-before: page; } nav { display: none; }
  figure, table { break-inside: avoid; } }
"""
_ESCAPES = {
    "\\": r"\textbackslash{}",
    **{sign: f"\\{sign}" for sign in "%&#_${}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "–": "--",
    "★": r"$\star$",
    "²": r"$^2$",
    "³": r"$^3$",
    "<": r"$<$",
    ">": r"$>$",
}


def as_html(title: str, sections: list[Section], footer: str, here: Path) -> str:
    """The whole page: figures are in it, pages on which episodes play are linked by their place below `here`."""
    links = "".join(f'<a href="#s{i}">{html.escape(section.title)}</a>' for i, section in enumerate(sections))
    body = "".join(_section(i, section, here) for i, section in enumerate(sections))
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{_STYLE}</style></head>'
        f"<body><h1>{html.escape(title)}</h1><nav>{links}</nav>{body}<footer><pre>{html.escape(footer)}</pre></footer>"
        "</body></html>\n"
    )


def _section(number: int, section: Section, here: Path) -> str:
    parts = [f'<section id="s{number}"><h2>{html.escape(section.title)}</h2>']
    parts += [f"<p>{html.escape(text)}</p>" for text in section.words if text]
    for table in section.tables:
        heads = "".join(f"<th>{html.escape(str(name))}</th>" for name in table.frame.columns)
        rows = "".join(
            "<tr>" + "".join(f"<td>{_cell(cell)}</td>" for cell in row) + "</tr>"
            for row in table.frame.itertuples(index=False)
        )
        parts.append(
            f'<div class="scroll"><table><caption>{html.escape(table.caption)}</caption><thead><tr>{heads}</tr></thead>'
            f"<tbody>{rows}</tbody></table></div>"
        )
    for figure in section.figures:
        data = base64.b64encode(figure.png.read_bytes()).decode()
        caption = html.escape(figure.caption)
        parts.append(
            f'<figure><img alt="{caption}" src="data:image/png;base64,{data}"><figcaption>{caption} '
            f"({html.escape(figure.png.stem)}.pdf)</figcaption></figure>"
        )
    if section.pages:
        links = (f'<a href="{_place(page, here)}">{html.escape(page.stem)}</a>' for page in section.pages)
        parts.append(f"<p>Watch: {', '.join(links)}</p>")
    parts += [f"<p><small>{html.escape(section.note)}</small></p>"] if section.note else []
    parts += [f"<pre>{html.escape(section.command)}</pre>"] if section.command else []
    return "\n".join([*parts, "</section>"])


def _cell(cell: object) -> str:
    """A value above its intervals."""
    value, bracket, intervals = str(cell).partition(" [")
    return html.escape(value) + (f"<small>{html.escape((bracket + intervals).strip())}</small>" if bracket else "")


def as_markdown(title: str, sections: list[Section], footer: str, here: Path) -> str:
    """The same; figures are linked by their place below `here`."""
    parts = [f"# {title}"]
    for section in sections:
        parts += [f"## {section.title}", *(text for text in section.words if text)]
        for table in section.tables:
            parts += [markdown_of(table.frame), table.caption]
        for figure in section.figures:
            parts.append(f"![{figure.caption}]({_place(figure.png, here)})")
        if section.pages:
            parts.append("Watch: " + ", ".join(f"[{page.stem}]({_place(page, here)})" for page in section.pages))
        parts += [section.note] if section.note else []
        parts += [f"```sh\n{section.command}\n```"] if section.command else []
    return "\n\n".join([*parts, f"```text\n{footer}\n```"]) + "\n"


def _place(path: Path, here: Path) -> str:
    """Where a file is, seen from a folder; a link as HTML and Markdown take it, whatever folders are called."""
    return quote(Path(os.path.relpath(path, here)).as_posix())


def as_latex(sections: list[Section]) -> str:
    """Every table as a booktabs float, and every figure."""
    parts = ["% \\usepackage{booktabs, graphicx}"]
    for section in sections:
        for table in section.tables:
            parts.append(_tabular(table.name, table.caption, table.frame))
        for figure in section.figures:
            name = f"{figure.png.parent.name}/{figure.png.stem}"
            parts.append(
                "\\begin{figure}\n\\centering\n"
                f"\\includegraphics[width=\\linewidth]{{figures/{name}.pdf}}\n"
                f"\\caption{{{escaped(figure.caption)}}}\n\\label{{fig:{name}}}\n\\end{{figure}}"
            )
    return "\n\n".join(parts) + "\n"


def _tabular(name: str, caption: str, frame: pd.DataFrame) -> str:
    lines = [
        " & ".join(escaped(str(cell)) for cell in row) + r" \\"
        for row in [frame.columns, *frame.itertuples(index=False)]
    ]
    return "\n".join(
        [
            r"\begin{table}",
            r"\centering\footnotesize",
            rf"\caption{{{escaped(caption)}}}",
            rf"\label{{tab:{name}}}",
            r"\resizebox{\linewidth}{!}{%",
            r"\begin{tabular}{l" + "r" * (len(frame.columns) - 1) + "}",
            r"\toprule",
            lines[0],
            r"\midrule",
            *lines[1:],
            r"\bottomrule",
            r"\end{tabular}}",
            r"\end{table}",
        ]
    )


def escaped(text: str) -> str:
    return "".join(_ESCAPES.get(sign, sign) for sign in text)


def write_report(folder: Path, title: str, sections: list[Section], footer: str) -> None:
    """Write index.html, report.md and report.tex into a folder."""
    write_text(folder / "index.html", as_html(title, sections, footer, folder))
    write_text(folder / "report.md", as_markdown(title, sections, footer, folder))
    write_text(folder / "report.tex", as_latex(sections))
