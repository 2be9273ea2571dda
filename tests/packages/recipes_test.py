"""Recipes of package managers, and the workflows: they parse, name this version, and set options that there are."""
import json
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
recipes = root / "cmake/recipes"
version = re.search(r'define DPR_VERSION "(.*)"', (root / "include/dpr/version.hpp").read_text())[1]
options = set(re.findall(r"option\((DPR_BUILD_\w+)", (root / "CMakeLists.txt").read_text()))

assert json.loads((recipes / "vcpkg/dpr/vcpkg.json").read_text())["version"] == version
assert re.search(r'version: "(.*)"', (recipes / "conda/recipe.yaml").read_text())[1] == version
conanfile = (recipes / "conan/conanfile.py").read_text()
assert f"version = {{{version}}}" in (root / ".github/CITATION.bib").read_text()
compile(conanfile, "conanfile.py", "exec")
parts = re.search(r"for part in \((.*)\)", conanfile)[1]
named = {"DPR_BUILD_" + part for part in re.findall(r'"(\w+)"', parts)}

files = [*recipes.rglob("*"), *(root / ".github").rglob("*"), root / "cmake/wheel.sh"]
texts = {file: file.read_text() for file in files if file.is_file()}
for file, text in texts.items():
    named |= set(re.findall(r"\bDPR_BUILD_[A-Z]+\b", text))
    for script in re.findall(r"\./(cmake/\w+\.sh)|\b(tests/packages/\w+\.sh)", text):
        assert (root / "".join(script)).is_file(), (file, script)
    try:
        import yaml
    except ModuleNotFoundError:
        continue
    if file.suffix in (".yaml", ".yml"):
        yaml.safe_load(text)
assert named <= options, named - options
