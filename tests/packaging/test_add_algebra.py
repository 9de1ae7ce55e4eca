"""hamotor_add_algebra: an algebra generated inside a user's own build."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest
from tests.packaging.cmake_projects import ROOT, build, configure, project, run

pytestmark = pytest.mark.slow

SPEC = """\
name = "line"
description = "two vectors"
basis = ["e1", "e2"]
gram = { diagonal = [1, SQUARE] }

[element.Scalar]
doc = "A number."
symbol = "s"
blades = ["s"]

[element.Vector]
doc = "A vector."
symbol = "v"
blades = ["e1", "e2"]

[kernels]
inner = ["Vector Vector -> Scalar"]
"""

MAIN = """\
#include <cstdio>

#include "hamotor/{name}/{name}.hpp"

int main() {{
  constexpr hamotor::{name}::Vector<int> v{{{numbers}}};
  std::printf("%d\\n", {product});
}}
"""


APP = "add_executable(app main.cpp)\ntarget_link_libraries(app PRIVATE hamotor::{name})"


def test_a_signature_becomes_a_target_with_a_test(tmp_path: Path) -> None:
    call = 'hamotor_add_algebra(foo SIGNATURE 2 2 1 KERNELS gp dexp "sandwich Versor Vector" TEST)'
    project(tmp_path, f"{call}\n{APP.format(name='foo')}")
    main = MAIN.format(name="foo", numbers="1, 2, 3, 4, 5", product="gp(v, v).s")
    (tmp_path / "main.cpp").write_text(main, encoding="utf-8")
    configured = configure(tmp_path)
    assert configured.returncode == 0, configured.stdout
    build = tmp_path / "build"
    run("cmake", "--build", build)
    assert run(build / "app") == "-28\n"
    assert "100% tests passed" in run("ctest", "--test-dir", build, "--no-tests=error")
    assert "no work to do" in run("cmake", "--build", build)
    text = (build / "hamotor_algebras" / "foo" / "foo.toml").read_text(encoding="utf-8")
    assert 'sandwich = ["Versor Vector"]' in text
    assert 'kernels = ["dexp"]' in text


def test_a_changed_spec_is_generated_again(tmp_path: Path) -> None:
    project(tmp_path, f"hamotor_add_algebra(line SPEC line.toml)\n{APP.format(name='line')}")
    main = MAIN.format(name="line", numbers="1, 2", product="inner(v, v)")
    (tmp_path / "main.cpp").write_text(main, encoding="utf-8")
    spec = tmp_path / "line.toml"
    spec.write_text(SPEC.replace("SQUARE", "1"), encoding="utf-8")
    configured = configure(tmp_path)
    assert configured.returncode == 0, configured.stdout
    build = tmp_path / "build"
    run("cmake", "--build", build)
    assert run(build / "app") == "5\n"
    spec.write_text(SPEC.replace("SQUARE", "-1"), encoding="utf-8")
    run("cmake", "--build", build)
    assert run(build / "app") == "-3\n"


def test_whatever_the_generator_reads_is_generated_and_compiled_from_again(tmp_path: Path) -> None:
    tree = tmp_path / "tree"
    for part in ("cmake", "generator/hamotor", "generator/algebras", "runtime", "templates"):
        shutil.copytree(ROOT / part, tree / part, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / ".clang-format", tree)
    launcher = tmp_path / "hamotor"
    (tree / "hamotor").write_text(
        f"#!/bin/sh\nPYTHONPATH='{tree / 'generator'}' exec '{sys.executable}' -m hamotor \"$@\"\n",
        encoding="utf-8",
    )
    (tree / "hamotor").chmod(0o755)
    launcher.symlink_to(tree / "hamotor")
    include = f'include("{tree / "cmake" / "HamotorAddAlgebra.cmake"}")'
    project(
        tmp_path, f"hamotor_add_algebra(line SPEC line.toml)\n{APP.format(name='line')}", include
    )
    (tmp_path / "line.toml").write_text(SPEC.replace("SQUARE", "1"), encoding="utf-8")
    main = '#include "hamotor/line/kernels.hpp"\nint main() {}\n'
    (tmp_path / "main.cpp").write_text(main, encoding="utf-8")
    folder = build(tmp_path, f"-DHAMOTOR_EXECUTABLE={launcher}")
    for file, comment in (
        ("runtime/include/hamotor/lanes.hpp", "// changed"),
        ("templates/kernels.hpp.jinja", "// changed"),
        ("generator/hamotor/files.py", "# changed"),
    ):
        with (tree / file).open("a", encoding="utf-8") as text:
            text.write(f"\n{comment}\n")
        said = run("cmake", "--build", folder)
        assert "Generating the algebra line" in said
        assert "main.cpp.o" in said
        assert "no work to do" in run("cmake", "--build", folder)


def test_a_spec_is_known_by_its_name_however_toml_writes_it(tmp_path: Path) -> None:
    include = f'include("{ROOT / "cmake" / "HamotorAddAlgebra.cmake"}")'
    project(tmp_path, "hamotor_add_algebra(line SPEC line.toml)", include)
    group = '[[group]]\nname = "Turn"\n'
    for name in ("name = 'line'", '  name="line"  # two vectors', '\tname\t= "line"'):
        text = SPEC.replace('name = "line"', name) + group
        (tmp_path / "line.toml").write_text(text, encoding="utf-8")
        configured = configure(tmp_path)
        assert configured.returncode == 0, configured.stdout


def test_an_installed_hamotor_calls_the_generator_it_is_given(tmp_path: Path) -> None:
    prefix, own = tmp_path / "prefix", tmp_path / "own"
    run("cmake", "-G", "Ninja", "-DHAMOTOR_BUILD_TESTS=OFF", "-S", ROOT, "-B", own)
    run("cmake", "--install", own, "--prefix", prefix)
    call = "hamotor_add_algebra(foo SIGNATURE 2 0 0 KERNELS gp)"
    user = tmp_path / "user"
    nowhere_else = "set(CMAKE_FIND_USE_SYSTEM_ENVIRONMENT_PATH OFF)\n"
    nowhere_else += "set(CMAKE_FIND_USE_CMAKE_SYSTEM_PATH OFF)"
    find = f"find_package(hamotor REQUIRED)\n{nowhere_else}"
    project(user, f"{call}\n{APP.format(name='foo')}", find)
    main = MAIN.format(name="foo", numbers="3, 4", product="gp(v, v).s")
    (user / "main.cpp").write_text(main, encoding="utf-8")
    found = f"-DCMAKE_PREFIX_PATH={prefix}"

    lost = configure(user, found)
    assert lost.returncode != 0
    assert "no generator found" in " ".join(lost.stdout.split())
    assert "HAMOTOR_EXECUTABLE" in lost.stdout

    configured = configure(user, found, f"-DHAMOTOR_EXECUTABLE={ROOT / 'hamotor'}")
    assert configured.returncode == 0, configured.stdout
    run("cmake", "--build", user / "build")
    assert run(user / "build" / "app") == "25\n"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("foo", "give either SIGNATURE P Q R or SPEC FILE"),
        ("foo SIGNATURE 2 0", "SIGNATURE needs three whole numbers P Q R"),
        ("foo SIGNATURE 2 -1 0", "SIGNATURE needs three whole numbers P Q R"),
        ("2foo SIGNATURE 2 0 0", "the name must match"),
        ("foo SPEC nowhere.toml", "no such file"),
        ("bar SPEC line.toml", 'is the spec of "line"'),
        ("line SPEC line.toml KERNELS gp", "go with SIGNATURE"),
        ("foo SIGNATURE 2 0 0 KERNEL gp", "SIGNATURE needs three whole numbers"),
        ("foo KERNEL gp", "unknown arguments: KERNEL;gp"),
        ("foo SIGNATURE 2 0 0 KERNELS", "no value for KERNELS"),
    ],
)
def test_a_wrong_call_is_explained_when_it_is_configured(
    tmp_path: Path, call: str, message: str
) -> None:
    include = f'include("{ROOT / "cmake" / "HamotorAddAlgebra.cmake"}")'
    project(tmp_path, f"hamotor_add_algebra({call})", include)
    (tmp_path / "line.toml").write_text(SPEC.replace("SQUARE", "1"), encoding="utf-8")
    refused = configure(tmp_path)
    assert refused.returncode != 0
    assert message in " ".join(refused.stdout.split())
