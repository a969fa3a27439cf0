# SPDX-License-Identifier: MIT
"""The public headers as cffi reads them: python3 cdef.py OUT INCLUDE_DIR"""
import re
import sys


def declarations(header):
    """What it declares, without comments, preprocessor and the bodies of functions."""
    text = re.sub(r"/\*.*?\*/", "", header, flags=re.S)
    text = re.sub(r"^#(?:[^\n]*\\\n)*[^\n]*\n", "", text, flags=re.M)
    text = re.sub(r"\bstatic inline\b[^;{]*\{.*?^\}\n", "", text, flags=re.M | re.S)
    return re.sub(r"\bANLOS_(API|BEGIN|END)\b", "", text)


def main():
    out, folder = sys.argv[1:]
    with open(folder + "/anlos/anlos.h", encoding="utf-8") as f:
        names = re.findall(r"^#include <(anlos/\w+\.h)>", f.read(), flags=re.M)
    headers = [open(f"{folder}/{name}", encoding="utf-8").read() for name in names]
    number = {k: int(v) for k, v in re.findall(
        r"^#define ANLOS_(ABI|VERSION_MAJOR|VERSION_MINOR|VERSION_PATCH) +(\d+)$",
        "".join(headers), flags=re.M)}
    version_number = (number["ABI"] << 24 | number["VERSION_MAJOR"] << 16
                      | number["VERSION_MINOR"] << 8 | number["VERSION_PATCH"])
    with open(out, "w", encoding="utf-8") as f:
        f.write(f"ABI = {number['ABI']}\n"
                f"VERSION_NUMBER = {version_number}\n"
                f"CDEF = {''.join(declarations(h) for h in headers)!r}\n")


main()
