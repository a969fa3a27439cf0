# SPDX-License-Identifier: MIT
"""nodes/README.md against the code: every function that it lists is where it says, and is
called by one above it in its table, or by what that one calls in its own file; and every
file that is a node is named."""

import functools
import pathlib
import re
import sys

ROOT = pathlib.Path(sys.argv[1])
PAGE = ROOT / "nodes" / "README.md"
ROW = re.compile(r"\| `([\w/.]+)` \| `(\w+)`(?: \(by way of `(\w+)`\))? \|")
TOPIC = re.compile(r"^## (\w+):.*hears `([\w/]+)`$")


@functools.cache
def functions(name):
    """Bodies by name, of definitions that begin a line and end with a brace in the first
    column."""
    text = (ROOT / name).read_text()
    found = re.finditer(r"^\w[^;{}()]*?\b(\w+)\([^;{}]*\)\n\{\n(.*?)^\}", text, re.M | re.S)
    return {match[1]: match[2] for match in found}


def reached(name, function):
    """All that it names, and what it calls in its file does."""
    bodies, waiting, words = functions(name), [function], set()
    done = set()
    while waiting:
        here = waiting.pop()
        if here in done:
            continue
        done.add(here)
        new = set(re.findall(r"\b\w+\b", bodies[here]))
        words |= new
        waiting += [word for word in new if word in bodies]
    return words


def does(file, way, function):
    """Is the function what stands for an operation, or called by it?"""
    starts = re.findall(rf"\.{way} = (\w+)", (ROOT / file).read_text())
    return any(start == function or function in reached(file, start) for start in starts)


def check_table(rows, wrong):
    known = []
    for file, function, way in rows:
        if not (ROOT / file).exists() or function not in functions(file):
            wrong.append(f"{file}: has no function {function}")
            continue
        by = way or function
        if known and not any(by in reached(*above) for above in known):
            wrong.append(f"{file}: {function} is not called by any above it")
        if way and not does(file, way, function):
            wrong.append(f"{file}: the operation {way} does not come to {function}")
        known.append((file, function))


def check_topic(node, topic, wrong):
    """The topic stands in the node's table of inputs."""
    constant = f'X({topic}, "{topic}",' in (ROOT / "msgs/topics.h").read_text()
    sources = "".join(path.read_text() for path in (ROOT / "nodes" / node).glob("*.c"))
    if not constant or f".topic = topic_{topic}," not in sources:
        wrong.append(f"nodes/{node}: does not hear {topic}")


def check_nodes(page, wrong):
    """Each file with the table of a node, and those alone."""
    part = page[page.index("| node | file |"):]
    told = set(re.findall(r"`(nodes/[\w/]+\.c)`", part[:part.index("\n\n")]))
    there = {str(path.relative_to(ROOT)) for path in (ROOT / "nodes").glob("*/*.c")
             if re.search(r"^const struct loop \w+ =", path.read_text(), re.M)}
    wrong += [f"{file}: is it a node?" for file in sorted(told ^ there)]


def main():
    page, wrong = PAGE.read_text(), []
    tables = [ROW.findall(part) for part in page.split("|---|---|---|\n")[1:]]
    for rows in tables:
        check_table(rows, wrong)
    for line in page.splitlines():
        if heard := TOPIC.match(line):
            check_topic(heard[1], heard[2], wrong)
    check_nodes(page, wrong)
    hops = {(file, function) for rows in tables for file, function, _ in rows}
    copies = page.count("(copy)")
    said = f"{len(hops)} functions in {len({file for file, _ in hops})} files, {copies} copies"
    if said not in page.replace("\n", " "):
        wrong.append(f"the page does not say that it lists {said}")
    if len(hops) < 30:
        wrong.append(f"only {len(hops)} functions were found in the page")
    print("\n".join(wrong) or said)
    return 1 if wrong else 0


sys.exit(main())
