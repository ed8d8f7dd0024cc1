#!/usr/bin/python3
"""Prints the summary of a demo scan and writes report.html beside its results.

usage: demo_report.py FOLDER
Reads what the cell left (figures.json) and the inspections against the simulator's truth.
"""
import html
import json
import pathlib
import sys


def millimetres(metres):
    return f"{metres * 1e3:.4f} mm"


def load(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def inspection_rows(folder):
    """Deviation figures with the poses of tf alone and registered."""
    rows = []
    for name, result in (("tf alone", "tf"), ("registered", ".")):
        figures = load(folder / result / "inspection.json")["inspection"]
        to_truth, to_model = figures["model_to_reference"], figures["reference_to_model"]
        rows.append([
            name,
            millimetres(to_truth["rms_m"]), millimetres(to_truth["p95_abs_m"]),
            millimetres(to_model["rms_m"]), millimetres(to_model["p95_abs_m"]),
            f"{100 * figures['completeness_ratio']:.2f} % within "
            f"{figures['complete_distance_m'] * 1e3:g} mm",
        ])
    return rows


INSPECTION_HEADER = ["poses", "model to truth rms", "95 %", "truth to model rms", "95 %",
                     "completeness of the visible surface"]


def scan_rows(figures):
    rows = [["views", str(figures["num_views"])], ["points", str(figures["num_points"])],
            ["points dropped before fusion", str(figures["num_dropped"])],
            ["mesh vertices", str(figures["num_vertices"])],
            ["overlap residual, poses of tf", millimetres(figures["rms_before_m"])],
            ["overlap residual, registered", millimetres(figures["rms_after_m"])]]
    rows += [[f"time: {stage}", f"{seconds:.1f} s"] for stage, seconds in figures["seconds"].items()]
    return rows


def table(header, rows):
    cells = "".join(f"<th>{html.escape(c)}</th>" for c in header)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in row) + "</tr>"
                   for row in rows)
    return f"<table><tr>{cells}</tr>{body}</table>"


def picture(file, caption):
    return (f'<figure><img src="{html.escape(file)}" alt="{html.escape(caption)}">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>")


STYLE = """body{font:15px/1.5 sans-serif;margin:2em auto;max-width:62em;color:#222}
table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid #ccc;padding:.3em .7em;text-align:right}
td:first-child,th:first-child{text-align:left}figure{display:inline-block;margin:.5em;max-width:48%}
img{max-width:100%;border:1px solid #ddd}figcaption{color:#555;font-size:90%}"""


def main():
    folder = pathlib.Path(sys.argv[1])
    figures = load(folder / "figures.json")
    deviation = inspection_rows(folder)
    scan = scan_rows(figures)

    print("\nSummary")
    for name, value in scan:
        print(f"  {name:32} {value:>14}")
    for warning in figures["warnings"]:
        print(f"  registration: {warning}")
    print("\n  " + " | ".join(INSPECTION_HEADER))
    for row in deviation:
        print("  " + " | ".join(row))

    page = f"""<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">
<title>fringe_fusion demo</title><style>{STYLE}</style></head><body>
<h1>A part scanned in the simulated cell</h1>
<p>The cell knows the commanded turntable angles only; the simulated table is off by .05 deg and .2 mm (standard deviation) at every
stop. Nothing was aligned to the truth before comparing.</p>
{table(INSPECTION_HEADER, deviation)}
{picture("mesh.png", "The fused mesh")}
{picture("inspection/deviation.png", "Signed deviation from the true part [mm]")}
{picture("tf/phase.png", "Projector column of view 000")}
{picture("tf/inspection/deviation.png", "Signed deviation with the poses of tf alone [mm]")}
{table(["scan", ""], scan)}
{table(["registration: what to look at"], [[w] for w in figures["warnings"]]) if figures["warnings"] else ""}
</body></html>
"""
    (folder / "report.html").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
