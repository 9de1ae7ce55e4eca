"""hamotor_dispatch: sources for several instruction sets inside a user's own build."""

from __future__ import annotations

import platform
from pathlib import Path

import pytest
from tests.packaging.cmake_projects import ROOT, attempt, build, configure, project, run

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(platform.machine() != "x86_64", reason="has one instruction set"),
]

SETS = ("sse2", "avx2", "avx512")

MAIN = """\
#include <cinttypes>
#include <cstdint>
#include <cstdio>

extern "C" const char* members_set();
extern "C" std::uint64_t members_hash(int);

int main() { std::printf("%s %016" PRIx64 "\\n", members_set(), members_hash(100)); }
"""

# What is inline and not inlined is what must not be mixed.
LANES = """\
#pragma once
#include <vector>

#include "hamotor/pack.hpp"

using Lanes = hamotor::Pack<double, 8>;
"""

MEMBERS = """\
#include <bit>
#include <cstdint>

#include "lanes.hpp"

extern "C" std::uint64_t members_hash(int count) {
  std::vector<Lanes> all;
  for (int k = 0; k < count; ++k) all.push_back(exp(sin(Lanes(0.37 * k))) * 0.7 + k);
  std::uint64_t hash = 0;
  for (const Lanes& lanes : all) hash = hash * 31 + std::bit_cast<std::uint64_t>(lanes[3]);
  return hash;
}
"""

SET = """\
#include "lanes.hpp"

extern "C" const char* members_set() { return hamotor::instruction_set.data(); }
"""

CALL = "hamotor_dispatch({} SOURCES set.cpp members.cpp FUNCTIONS members_set members_hash)"
LINK = "target_link_libraries({} PRIVATE hamotor::hamotor)"
APP = f"add_executable(app main.cpp)\n{CALL.format('app')}\n{LINK.format('app')}"


def sources(folder: Path, **extra: str) -> None:
    """Write the program and what it dispatches, some of it with lines of a test before it."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {"main": MAIN, "members": MEMBERS, "set": SET}
    for name, text in texts.items():
        (folder / f"{name}.cpp").write_text(extra.get(name, "") + text, encoding="utf-8")
    (folder / "lanes.hpp").write_text(LANES, encoding="utf-8")


def computes_the_same_on_every_set(program: Path) -> None:
    """Each set that this processor has is what is told, and has the same bits."""
    best, bits = run("env", "HAMOTOR_ISA=", program).split()
    for isa in SETS[: SETS.index(best) + 1]:
        assert run("env", f"HAMOTOR_ISA={isa}", program).split() == [isa, bits]


OPTIONS = {
    "interprocedural": (
        "-DCMAKE_INTERPROCEDURAL_OPTIMIZATION_RELEASE=ON",
        "-DCMAKE_BUILD_TYPE=Release",
    ),
    "lto": ("-DCMAKE_CXX_FLAGS=-flto -march=native",),
    "unity": (
        "-DCMAKE_CXX_FLAGS=-mavx2 -Werror",
        "-DCMAKE_UNITY_BUILD=ON",
        "-DCMAKE_BUILD_TYPE=Debug",
    ),
}


@pytest.mark.parametrize(
    ("compiler", "options"),
    [
        ("g++", "interprocedural"),
        ("clang++", "lto"),
        ("g++", "unity"),
        pytest.param("clang++", "interprocedural", marks=pytest.mark.long),
        pytest.param("g++", "lto", marks=pytest.mark.long),
        pytest.param("clang++", "unity", marks=pytest.mark.long),
    ],
)
def test_options_of_a_project_leave_instruction_sets_apart(
    tmp_path: Path, compiler: str, options: str
) -> None:
    own = "namespace {\n[[maybe_unused]] int choose() { return 1; }\n}  // namespace\n"
    sources(tmp_path, main=own, members=own, set=own)
    project(tmp_path, APP)
    folder = build(tmp_path, f"-DCMAKE_CXX_COMPILER={compiler}", *OPTIONS[options])
    computes_the_same_on_every_set(folder / "app")


def test_what_is_said_of_a_target_later_reaches_what_it_dispatches(tmp_path: Path) -> None:
    """Libraries, generated headers, the language and what is precompiled."""
    later = """
        foreach(name made own)
          add_custom_command(OUTPUT ${name}/${name}.hpp COMMAND ${CMAKE_COMMAND} -E sleep 0.3
                             COMMAND ${CMAKE_COMMAND} -E touch ${name}/${name}.hpp)
          add_custom_target(make_${name} DEPENDS ${name}/${name}.hpp)
        endforeach()
        add_library(mine INTERFACE)
        add_dependencies(mine make_made)
        target_include_directories(mine INTERFACE ${CMAKE_CURRENT_BINARY_DIR}/made)
        target_compile_definitions(mine INTERFACE MINE=1)
        target_compile_options(mine INTERFACE -DOPTION=2 -march=native -mavx2)
        target_compile_options(app PRIVATE -mfma)
        target_link_libraries(app PRIVATE mine)
        add_dependencies(app make_own)
        target_include_directories(app PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/own)
        target_precompile_headers(app PRIVATE <numeric>)
        set_target_properties(app PROPERTIES CXX_EXTENSIONS OFF)"""
    check = """\
        #include "made.hpp"
        #include "own.hpp"
        static_assert(MINE == 1 && OPTION == 2 && std::gcd(4, 6) == 2);
        #ifdef unix
        #error "the target is without extensions"
        #endif
        """
    sources(tmp_path, members=check)
    project(tmp_path, APP + later)
    computes_the_same_on_every_set(build(tmp_path) / "app")


def test_libraries_of_an_installed_hamotor_in_a_folder_of_any_name(tmp_path: Path) -> None:
    """Static and shared, each of another folder than its two calls."""
    prefix = tmp_path / "prefix of it"
    run("cmake", "-G", "Ninja", "-DHAMOTOR_BUILD_TESTS=OFF", "-S", ROOT, "-B", tmp_path / "own")
    run("cmake", "--install", tmp_path / "own", "--prefix", prefix)
    user = tmp_path / "a user's"
    sources(user / "sub folder")
    (user / "empty.cpp").touch()
    libraries = """
        foreach(kind STATIC SHARED)
          add_library(my-${kind}.lib ${kind} empty.cpp)
          add_executable(${kind} "sub folder/main.cpp")
          target_link_libraries(my-${kind}.lib PUBLIC hamotor::hamotor)
          target_link_libraries(${kind} my-${kind}.lib)
        endforeach()
        add_subdirectory("sub folder")"""
    calls = """
        foreach(kind STATIC SHARED)
          hamotor_dispatch(my-${kind}.lib SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/members.cpp
                           FUNCTIONS members_hash)
          hamotor_dispatch(my-${kind}.lib SOURCES $<IF:$<CONFIG:Debug>,set.cpp,none.cpp>
                           FUNCTIONS members_set)
        endforeach()"""
    project(user, libraries, "find_package(hamotor REQUIRED)")
    (user / "sub folder" / "CMakeLists.txt").write_text(calls, encoding="utf-8")
    options = [f"-DCMAKE_PREFIX_PATH={prefix}", "-DCMAKE_BUILD_TYPE=Debug"]
    folder = build(user, *options)
    computes_the_same_on_every_set(folder / "STATIC")
    computes_the_same_on_every_set(folder / "SHARED")


def test_make_generates_a_source_once_and_follows_the_list_of_functions(tmp_path: Path) -> None:
    made = """
        add_custom_command(
          OUTPUT members.cpp DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/members.cpp VERBATIM
          COMMAND ${CMAKE_COMMAND} -E copy ${CMAKE_CURRENT_SOURCE_DIR}/members.cpp members.cpp
          COMMAND ${CMAKE_COMMAND} -E echo "made once" COMMAND ${CMAKE_COMMAND} -E sleep 0.3)
        include_directories(.)
        """
    all_made = made + APP.replace(" members.cpp", " ${CMAKE_CURRENT_BINARY_DIR}/members.cpp")
    sources(tmp_path)
    project(tmp_path, all_made)
    configured = configure(tmp_path, generator="Unix Makefiles")
    assert configured.returncode == 0, configured.stdout
    folder = tmp_path / "build"
    assert run("cmake", "--build", folder, "-j3").count("made once") == 1
    computes_the_same_on_every_set(folder / "app")

    wrong = all_made.replace("members_hash", "members_hash member_count")
    project(tmp_path, wrong)
    refused = attempt("cmake", "--build", folder)
    assert refused.returncode != 0
    assert "required symbol `member_count' not defined" in refused.stdout


def test_each_configuration_dispatches_its_own(tmp_path: Path) -> None:
    sources(tmp_path)
    (tmp_path / "set.cpp").write_text(
        '#ifdef NDEBUG\n#define NAME "release"\n#else\n#define NAME "debug"\n#endif\n'
        'extern "C" const char* members_set() { return NAME; }\n',
        encoding="utf-8",
    )
    project(tmp_path, APP)
    options = [f"-DCMAKE_{name}_CONFIGS=all" for name in ("CROSS", "DEFAULT")]
    types = ["-DCMAKE_CONFIGURATION_TYPES=Debug;Release", "-DCMAKE_DEFAULT_BUILD_TYPE=Debug"]
    folder = build(tmp_path, *options, *types, generator="Ninja Multi-Config")
    for name in ("Debug", "Release"):
        assert run(folder / name / "app").split()[0] == name.lower()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("none SOURCES set.cpp FUNCTIONS f", "there is no such target; add it before"),
        ("inner SOURCES set.cpp FUNCTIONS f", "a target of type OBJECT_LIBRARY; allowed are"),
        ("app FUNCTIONS f", "give SOURCES FILE... and FUNCTIONS NAME..."),
        ("app OPTION SOURCES set.cpp FUNCTIONS f", "unknown arguments: OPTION; allowed are"),
        ("app SOURCES set.cpp FUNCTIONS a::f", '"a::f" is not the name of an extern "C" function'),
        ("app SOURCES set.cpp FUNCTIONS f f", '"f" is listed twice'),
        ("app SOURCES set.cpp FUNCTIONS g", '"g" is listed twice'),
        ("app SOURCES ./main.cpp FUNCTIONS f", "./main.cpp is among the target's other sources"),
    ],
)
def test_a_wrong_call_is_explained_when_it_is_configured(
    tmp_path: Path, call: str, message: str
) -> None:
    sources(tmp_path)
    include = f'include("{ROOT / "cmake" / "HamotorDispatch.cmake"}")'
    targets = "add_executable(app main.cpp)\nadd_library(inner OBJECT main.cpp)\n"
    one = "hamotor_dispatch(app SOURCES members.cpp FUNCTIONS g)\n"
    project(tmp_path, f"{targets}{one}hamotor_dispatch({call})", include)
    refused = configure(tmp_path)
    assert refused.returncode != 0
    assert message in " ".join(refused.stdout.split())
