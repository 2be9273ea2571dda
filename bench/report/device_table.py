"""The table of devices: what cmake/devices.sh left in a folder, as CSV and, printed, as Markdown.

Usage: device_table.py FOLDER TABLE.csv. Rows of the table that the folder does not have are kept.
"""

import csv
import json
import pathlib
import sys
import xml.etree.ElementTree

COLUMNS = ["row", "device", "driver", "lanes", "tests_passed", "tests", "failing", "compared", "compared_passed",
           "worst_image", "worst_gradient", "worst_of_bound", "cube128_ms", "sphere256_ms"]

QUIET = 1.25  # the most that the median of undisturbed runs is above the fastest


def tests(folder):
    """Passed cases, all cases, and the names of the others; nothing where none was run."""
    file = folder / "tests.xml"
    if not file.exists():
        return {}
    try:
        cases = xml.etree.ElementTree.parse(file).findall(".//testcase")
    except xml.etree.ElementTree.ParseError:
        return {"tests_passed": 0, "tests": 0, "failing": "the process did not end as it should"}
    failing = [case.get("name") for case in cases if case.find("failure") is not None or case.find("error") is not None]
    return {"tests_passed": len(cases) - len(failing), "tests": len(cases), "failing": "; ".join(failing)}


def self_test(folder):
    """Output of `dpr devices --json --check`; the differences are of exact stages alone: samples have errors."""
    device = json.loads((folder / "check.json").read_text())[0]
    rows = device["check"]["rows"]
    exact = [row for row in rows if "worst" in row and "sampled" not in row["stage"] and "contour" not in row["stage"]]

    def worst(word):
        values = [row["worst"] for row in exact if word in row["compared"]]
        return "" if not values or None in values else f"{max(values):.1e}"

    shares = [row["worst"] / row["bound"] for row in exact if row["bound"] > 0 and row["worst"] is not None]
    return {"device": device["name"], "driver": f"{device['platform']} {device['driver']}", "lanes": device["lanes"],
            "compared": len(rows), "compared_passed": sum(row["passed"] for row in rows),
            "worst_image": worst("image"), "worst_gradient": worst("gradient"), "worst_of_bound": f"{max(shares):.2f}"}


def benchmark(folder):
    """The fastest of the runs, forward + backward, of the exact barrier with Gaussian noise; none where other work disturbed them."""
    if not (folder / "bench.json").exists():
        return {}
    figures = {}
    for row in json.loads((folder / "bench.json").read_text())["results"]:
        kind = (row["preset"], row["composition"], row["estimator"], row["status"])
        if kind == ("gaussian", "barrier", "exact", "ok"):
            passes = [row["forward_ms"], row["backward_ms"]]
            if all(times["median"] <= QUIET * times["min"] for times in passes):
                figures[row["workload"] + "_ms"] = " + ".join(f"{times['min']:.3g}" for times in passes)
    return figures


def print_markdown(rows):
    print("| device | driver | lanes | tests passed | compared | worst image | worst gradient | cube128, ms | "
          "sphere256, ms |")
    print("|---|---|---|---|---|---|---|---|---|")
    for row in rows:
        tested = f"{row['tests_passed']} of {row['tests']}" if row["tests"] else ""
        print(f"| {row['device']} | {row['driver']} | {row['lanes']} | {tested} | "
              f"{row['compared_passed']} of {row['compared']} | {row['worst_image']} | {row['worst_gradient']} | "
              f"{row['cube128_ms']} | {row['sphere256_ms']} |")


def main():
    folder, table = map(pathlib.Path, sys.argv[1:])
    rows = {}
    if table.exists():
        with open(table, newline="") as file:
            rows = {row["row"]: row for row in csv.DictReader(file)}
    for entry in sorted(folder.iterdir()):
        if (entry / "check.json").exists():
            rows[entry.name] = {"row": entry.name, **self_test(entry), **tests(entry), **benchmark(entry)}
    ordered = [{column: row.get(column, "") for column in COLUMNS} for _, row in sorted(rows.items())]
    with open(table, "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(ordered)
    print_markdown(ordered)


if __name__ == "__main__":
    main()
