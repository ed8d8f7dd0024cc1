#!/usr/bin/python3
"""Writes the keys of several YAML maps into one, later files over earlier ones.

usage: merge_yaml.py OUTPUT INPUT...
"""
import pathlib
import sys

import yaml


def main():
    merged = {}
    for path in sys.argv[2:]:
        with open(path, encoding="utf-8") as file:
            merged.update(yaml.safe_load(file) or {})
    output = pathlib.Path(sys.argv[1])
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(yaml.safe_dump(merged), encoding="utf-8")


if __name__ == "__main__":
    main()
