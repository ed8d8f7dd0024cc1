#!/usr/bin/python3
"""Counts the test cases of a run from its GoogleTest XML files and ctest's record.

usage: test_summary.py RESULTS_FOLDER CTEST_FOLDER
"""
import pathlib
import sys
import xml.etree.ElementTree as ET


def count_cases(results):
    """(passed, failed, skip messages) over all XML files below `results`."""
    passed, failed, skips = 0, 0, []
    for path in sorted(pathlib.Path(results).rglob("*.xml")):
        try:
            root = ET.parse(path).getroot()
        except ET.ParseError as error:
            print(f"{path}: unreadable test result: {error}")
            failed += 1
            continue
        if path.name.startswith("rostest-"):  # repeats what the rostest's own gtest file says
            continue
        for case in root.iter("testcase"):
            skipped = case.find("skipped")
            if case.find("failure") is not None or case.find("error") is not None:
                failed += 1
            elif skipped is not None or case.get("result") == "skipped":
                text = (skipped.get("message") or skipped.text or "") if skipped is not None else ""
                skips.append(f"{case.get('classname')}.{case.get('name')}: {text}")
            else:
                passed += 1
    return passed, failed, skips


def failed_programs(ctest_folder):
    """Names in ctest's list of failed tests: a crash leaves no XML file to count."""
    path = pathlib.Path(ctest_folder) / "Temporary" / "LastTestsFailed.log"
    return path.read_text().split() if path.exists() else []


def main():
    passed, failed, skips = count_cases(sys.argv[1])
    programs = failed_programs(sys.argv[2])
    for skip in skips:
        print("skipped:", " ".join(skip.split()))
    for program in programs:
        print("failed:", program)
    failed = max(failed, len(programs))
    if passed + failed == 0:
        print("no test was run")
    print(f"{passed} passed, {failed} failed, {len(skips)} skipped")
    return 0 if failed == 0 and passed > 0 else 1


if __name__ == "__main__":
    sys.exit(main())
