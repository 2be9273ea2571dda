#!/usr/bin/env python3
"""The code in the documents, tried: C++ becomes a program, commands and Python are run, JSON is parsed.

blocks.py cpp DOCUMENT OUTPUT.cpp   the C++ blocks of a document, one after the other, as one main()
blocks.py links ROOT                every link in the documents below a folder leads to a file, and to a heading
blocks.py run DOCUMENT --source DIR --build DIR --work DIR [--program FILE] [--python FILE]
                                    everything else, in an empty folder that looks like the repository's root

Blocks of other languages (console, text) are not tried. A block after a line <!-- file: NAME --> is written to that file;
one after <!-- shows: NAME --> must be that file of the repository, which is tried elsewhere; one after
<!-- quotes: NAME --> must be lines of it that follow one another.
"""
import argparse
import json
import os
import pathlib
import re
import shutil
import stat
import subprocess
import sys

# Options that make a command of a document short enough for a test.
REDUCED = {
    "dpr fit": "--iterations 4",
    "dpr bench --workload": "--repetitions 1 --max-seconds 0.01",
    "dpr learn data": "--train 2 --val 1 --test 1 --classes sofa",
    "dpr learn train": "--steps 2 --classes sofa",
    "dpr learn eval": "--classes sofa",
    "dpr learn show": "--classes sofa",
    "dpr_experiments": "--smoke",
    "dpr_pose_table": "--smoke",
}


def blocks(document):
    """(language, first line, marker of a file or None, text) of every fenced block."""
    found, language, marker = [], None, None
    for number, line in enumerate(document.read_text().splitlines(), 1):
        fence = re.match(r"\s*```(\S*)", line)
        if language is None and fence:
            language, first, text = fence.group(1), number + 1, []
        elif language is not None and fence:
            found.append((language, first, marker, "\n".join(text) + "\n"))
            language, marker = None, None
        elif language is not None:
            text.append(line)
        elif comment := re.match(r"<!-- (file|shows|quotes): (\S+) -->", line):
            marker = comment.groups()
    if language is not None:
        sys.exit(f"{document}: a block is not closed")
    return found


def write_cpp(document, output):
    includes, body = [], []
    for language, first, marker, text in blocks(document):
        if language != "cpp" or marker:
            continue
        lines = text.splitlines()
        includes += [line for line in lines if line.startswith("#include")]
        body.append(f'#line {first} "{document}"')
        body += ["" if line.startswith("#include") else line for line in lines]
    source = "\n".join(includes + ["int main() {"] + body + ["}", ""])
    output.write_text(source)


def make_script(file, lines):
    file.write_text("#!/bin/sh\n" + lines)
    file.chmod(file.stat().st_mode | stat.S_IXUSR)


def make_programs(folder, build, is_reduced, python):
    """The programs under their names, with what reduces them, and `python3` as the interpreter that has the modules."""
    folder.mkdir()
    for program in ("dpr", "dpr_experiments", "dpr_pose_table"):
        cases = []
        for command, options in REDUCED.items() if is_reduced else ():
            words = command.split()
            if words[0] != program:
                continue
            pattern = " ".join(words[1:]) + (" *" if words[1:] else "*")
            cases.append(f'  "{pattern}") set -- "$@" {options} ;;'.replace('*"', '"*'))
        lines = "case \"$*\" in\n" + "\n".join(cases) + "\nesac\n"
        make_script(folder / program, f'{lines}exec {build}/bin/{program} "$@"\n')
    make_script(folder / "python3", f'exec {python} "$@"\n')


def require_ignored(source, work, kept):
    """What the document's commands leave in the root of a checkout must not show up in `git status`."""
    if subprocess.run(["git", "-C", source, "rev-parse"], capture_output=True, check=False).returncode:
        return  # not a checkout
    left = [name + "/" * (work / name).is_dir() for name in sorted(set(os.listdir(work)) - kept)]
    ignored = subprocess.run(["git", "-C", source, "check-ignore", "--no-index", *left], capture_output=True, text=True,
                             check=False).stdout.split("\n")
    if litter := [name for name in left if name not in ignored]:
        sys.exit(f".gitignore lacks {', '.join(litter)}")


def run(arguments):
    work, build = arguments.work, arguments.build.resolve()
    shutil.rmtree(work, ignore_errors=True)
    (work / "build").mkdir(parents=True)
    (work / "build/release").symlink_to(build)
    for folder in ("bench", "include", "tests"):
        (work / folder).symlink_to(arguments.source.resolve() / folder)
    make_programs(work / "programs", build, not arguments.full, arguments.python or sys.executable)
    environment = {**os.environ, "PATH": f"{(work / 'programs').resolve()}:{os.environ['PATH']}",
                   "PYTHONPATH": "build/release/python"}

    def call(what, *command):
        print(f"== {what}", flush=True)
        if subprocess.run(command, cwd=work, env=environment, check=False).returncode:
            sys.exit(f"{what} failed")

    kept = set(os.listdir(work))
    call("dpr demo", "dpr", "demo", "-o", "demo-output", "--quiet")
    tried, python = 0, ""
    for language, first, marker, text in blocks(arguments.document):
        where = f"{arguments.document}:{first}"
        action, name = marker or (None, None)
        if action == "file":
            (work / name).write_text(text)
        elif action == "shows" and text != (arguments.source / name).read_text():
            sys.exit(f"{where} is not {name}")
        elif action == "quotes" and "\n" + text not in "\n" + (arguments.source / name).read_text():
            sys.exit(f"{where} is not in {name}")
        tried += action in ("shows", "quotes")
        if language == "json":
            try:
                json.loads(text)
            except ValueError as error:
                sys.exit(f"{where}: {error}")
        elif language == "sh":
            call(where, "bash", "-euo", "pipefail", "-c", text)
        elif language == "python" and action != "file":
            python += "\n" * (first - 1 - python.count("\n")) + text
        tried += language in ("json", "sh", "python")
    if python and arguments.python:
        (work / "programs/document.py").write_text(python)
        call(f"{arguments.document}, Python", arguments.python, "programs/document.py")
    if arguments.program:
        call(f"{arguments.document}, C++", str(arguments.program.resolve()))
        tried += 1
    require_ignored(arguments.source, work, kept)
    if tried == 0:
        sys.exit(f"{arguments.document} has nothing to try")


def headings(document):
    """Anchors as GitHub makes them, of the lines that are headings and not code."""
    in_code, found = False, set()
    for line in document.read_text().splitlines():
        in_code ^= line.lstrip().startswith("```")
        if line.startswith("#") and not in_code:
            found.add(re.sub(r"[^\w\- ]", "", line.lstrip("#").strip().lower()).replace(" ", "-"))
    return found


def documents_of(root):
    """All but what is built, and the one that is to fail."""
    for folder, folders, files in os.walk(root):
        folders[:] = [name for name in folders if name not in ("build", ".git")]
        for name in files:
            if name.endswith(".md") and (name != "broken.md" or pathlib.Path(folder) == root):
                yield pathlib.Path(folder) / name


def check_links(root):
    broken, count = [], 0
    for document in documents_of(root):
        text = "\n".join(line for line in document.read_text().splitlines() if not line.startswith("    "))
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            if re.match(r"\w+:", target):
                continue
            count += 1
            path, _, anchor = target.partition("#")
            file = document.parent / path if path else document
            if not file.exists() or (anchor and anchor not in headings(file)):
                broken.append(f"{document.relative_to(root)}: {target}")
    if broken or count == 0:
        sys.exit("\n".join(["broken links:", *broken]))
    print(f"{count} links")


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
modes = parser.add_subparsers(required=True)
cpp = modes.add_parser("cpp")
cpp.add_argument("document", type=pathlib.Path)
cpp.add_argument("output", type=pathlib.Path)
cpp.set_defaults(action=lambda a: write_cpp(a.document, a.output))
try_all = modes.add_parser("run")
try_all.add_argument("document", type=pathlib.Path)
for option in ("--source", "--build", "--work"):
    try_all.add_argument(option, type=pathlib.Path, required=True)
try_all.add_argument("--program", type=pathlib.Path)
try_all.add_argument("--python")
try_all.add_argument("--full", action="store_true", help="commands as they are, not reduced for a test")
try_all.set_defaults(action=run)
links = modes.add_parser("links")
links.add_argument("root", type=pathlib.Path)
links.set_defaults(action=lambda a: check_links(a.root.resolve()))
chosen = parser.parse_args()
chosen.action(chosen)
