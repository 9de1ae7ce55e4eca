"""A library generated for a new algebra: it builds and proves itself, and spares others' files."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from hamotor.codegen import generate_library, starter_spec
from hamotor.codegen.library import library as kernels_of
from hamotor.codegen.spec import parse_algebra
from hamotor.errors import UsageError

SMALL = ("gp", "outer", "sandwich", "reverse")
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")


def library(
    folder: Path,
    signature: tuple[int, int, int] = (2, 0, 0),
    null_pairs: int = 0,
    products: tuple[str, ...] | None = SMALL,
) -> None:
    text = starter_spec("foo", signature, null_pairs, products)
    generate_library(text, "foo.toml", folder)


def run(*command: str | Path) -> str:
    answer = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
    return answer.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("signature", "null_pairs"),
    [
        ((2, 0, 1), 0),
        ((3, 1, 0), 1),
        ((2, 2, 1), 0),
        ((1, 1, 0), 0),
        ((0, 3, 0), 0),
        ((0, 1, 0), 0),
        ((1, 0, 3), 0),
    ],
    ids=[
        "degenerate",
        "null pair",
        "mixed and degenerate",
        "mixed",
        "negative",
        "one dimension",
        "mostly null",
    ],
)
def test_the_folder_builds_alone_and_its_test_proves_it(
    tmp_path: Path, signature: tuple[int, int, int], null_pairs: int
) -> None:
    library(tmp_path / "foo", signature, null_pairs, products=None)
    build = tmp_path / "build"
    flags = " ".join(["-DCMAKE_CXX_FLAGS=-O1", *WARNINGS])
    run("cmake", "-G", "Ninja", flags, "-S", tmp_path / "foo", "-B", build)
    run("cmake", "--build", build)
    run("ctest", "--test-dir", build, "--no-tests=error")
    shown = run(build / "foo_test")
    assert "comparisons, 0 failures" in shown
    assert int(shown.split()[1]) >= 4 ** sum(signature)


@pytest.mark.parametrize(
    "signature",
    [(p, q, n - p - q) for n in range(1, 5) for p in range(n + 1) for q in range(n + 1 - p)]
    + [(3, 1, 1), (1, 3, 1), (2, 1, 2), (0, 1, 4)],
    ids=lambda signature: ",".join(map(str, signature)),
)
def test_every_signature_has_a_library(signature: tuple[int, int, int]) -> None:
    for null_pairs in range(min(signature[:2]) + 1):
        text = starter_spec("foo", signature, null_pairs)
        assert kernels_of(parse_algebra(text, "foo.toml"))


def test_the_test_of_few_kernels_compiles_without_warnings(tmp_path: Path) -> None:
    for product in ("outer", "reverse", "exp"):
        library(tmp_path / product, (3, 0, 0), products=(product,))
        source = tmp_path / product / "test" / "foo_test.cpp"
        include = tmp_path / product / "include"
        run("g++", "-std=c++20", "-fsyntax-only", *WARNINGS, "-I", include, source)


def built_test(folder: Path) -> str:
    """What the generated test says."""
    include, source = folder / "include", folder / "test" / "foo_test.cpp"
    run("g++", "-std=c++20", *WARNINGS, "-I", include, source, "-o", folder / "foo_test")
    return run(folder / "foo_test")


@pytest.mark.slow
def test_chains_are_compared_on_all_tuples(tmp_path: Path) -> None:
    chains = (
        "outer Vector Vector Vector",
        "regressive Bivector Bivector Bivector -> Scalar",
        "gp Even Even Even",
    )
    library(tmp_path, (3, 0, 0), products=chains)
    products = 5**2 * 4 + 4**3 + 4**3 + 5**3 * 4  # of the group's element, of the chains
    assert f"foo: {products} comparisons, 0 failures" in built_test(tmp_path)


@pytest.mark.slow
def test_a_library_without_products_passes_its_test(tmp_path: Path) -> None:
    library(tmp_path, (1, 0, 0), products=("reverse", "norm"))
    assert "foo: 0 comparisons, 0 failures" in built_test(tmp_path)


ROUND_TRIPS = """
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include "hamotor/foo/foo.hpp"

using namespace hamotor::foo;

template <class T>
double difference(const T& a, const T& b) {
  double most = 0.0;
  double size = 0.0;
  for (std::size_t i = 0; i < T::size; ++i) {
    const double apart = std::fabs(a.components()[i] - b.components()[i]);
    if (!(apart < 1e300)) return 1e300;  // nor is NaN near anything
    most = std::max(most, apart);
    size = std::max(size, std::fabs(b.components()[i]));
  }
  return most <= size ? most / size : 1e300;
}

int main() {
  std::mt19937 engine(1);
  std::normal_distribution<double> normal;
  double worst = 0.0;
  for (int i = 0; i < 20000; ++i) {
    std::array<double, Bivector<double>::size> numbers;
    for (double& x : numbers) x = 0.35 * normal(engine);
    const auto b = Bivector<double>::from(numbers);
    const auto m = exp(b);
    const auto root = sqrt(m);
    worst = std::max({worst, difference(exp(log(m)), m), difference(gp(root, root), m),
                      difference(cayley_inverse(cayley(b)), b)});
  }
  std::printf("%.1e", worst);
}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("signature", "null_pairs"),
    [((2, 2, 0), 0), ((2, 2, 0), 1), ((3, 2, 0), 0), ((3, 1, 1), 0), ((2, 1, 2), 0)],
)
def test_rotations_and_boosts_are_undone_in_every_signature(
    tmp_path: Path, signature: tuple[int, int, int], null_pairs: int
) -> None:
    products = ("gp", "exp", "log", "sqrt", "cayley", "cayley_inverse")
    library(tmp_path / "foo", signature, null_pairs, products)
    source = tmp_path / "trips.cpp"
    source.write_text(ROUND_TRIPS, encoding="utf-8")
    include = tmp_path / "foo" / "include"
    run("g++", "-std=c++20", "-O1", *WARNINGS, "-I", include, source, "-o", tmp_path / "trips")
    assert float(run(tmp_path / "trips")) < 1e-11


ISOCLINIC = """
#include <algorithm>
#include <cmath>
#include <cstdio>
#include "hamotor/foo/foo.hpp"

using namespace hamotor::foo;

int main() {
  double worst = 0.0;
  for (const double x : {0.1, 0.5, 1.0, 2.0, 3.0, 4.0}) {
    for (const double other : {1.0, 1.0 + 1e-8, 1.0001, 0.3, 0.01}) {
      for (const double turn : {0.0, 1e-30, 1e-9}) {
        for (const double sign : {1.0, -1.0}) {
          Bivector<double> b{};
          b.e13 = x;
          b.e24 = sign * other * x;
          b.e12 = turn;
          b.e34 = -turn;
          const auto found = log(exp(b)).components();
          for (std::size_t i = 0; i < found.size(); ++i) {
            const double apart = std::fabs(found[i] - b.components()[i]);
            if (!(apart <= worst * std::cosh(2 * x))) worst = apart / std::cosh(2 * x);
            if (std::isnan(apart)) return 1;
          }
        }
      }
    }
  }
  std::printf("%.1e", worst);
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("signature", [(2, 2, 0), (3, 2, 0), (2, 2, 1)])
def test_log_of_two_boosts_that_are_nearly_equal(
    tmp_path: Path, signature: tuple[int, int, int]
) -> None:
    library(tmp_path / "foo", signature, products=("exp", "log"))
    source = tmp_path / "isoclinic.cpp"
    names = {(3, 2, 0): ("e14", "e25", "e12", "e45")}.get(signature, ("e13", "e24", "e12", "e34"))
    text = ISOCLINIC
    for old, new in zip(("e13", "e24", "e12", "e34"), names, strict=True):
        text = text.replace(f"b.{old}", f"b.{new}")
    source.write_text(text, encoding="utf-8")
    include = tmp_path / "foo" / "include"
    run("g++", "-std=c++20", "-O1", *WARNINGS, "-I", include, source, "-o", tmp_path / "isoclinic")
    assert float(run(tmp_path / "isoclinic")) < 1e-14


def test_the_same_text_changes_nothing_the_second_time(tmp_path: Path) -> None:
    library(tmp_path)
    text = starter_spec("foo", (2, 0, 0), 0, SMALL)
    assert generate_library(text, "foo.toml", tmp_path, check=True) == []
    stale = tmp_path / "include" / "hamotor" / "foo" / "kernels.hpp"
    stale.write_text("", encoding="utf-8")
    (found,) = generate_library(text, "foo.toml", tmp_path, check=True)
    assert (found.kind, found.path) == ("stale", "include/hamotor/foo/kernels.hpp")
    assert stale.read_text(encoding="utf-8") == ""


def test_only_the_listed_products_and_those_of_groups_are_written(tmp_path: Path) -> None:
    library(tmp_path, products=("outer",))
    kernels = tmp_path / "include" / "hamotor" / "foo" / "kernels.hpp"
    text = kernels.read_text(encoding="utf-8")
    written = set(re.findall(r"^/// (\w+): .* -> ", text, re.MULTILINE))
    defects = {"unit_defect", "unit_defect_change", "unit_correction"}
    assert written == {"outer", "gp", "reverse"} | defects


def test_a_folder_with_anything_else_in_it_is_refused_untouched(tmp_path: Path) -> None:
    mine = tmp_path / "thesis.tex"
    mine.write_text("years of work", encoding="utf-8")
    with pytest.raises(UsageError, match="holds files that are not a library of foo"):
        library(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_another_algebras_folder_is_refused(tmp_path: Path) -> None:
    library(tmp_path)
    text = starter_spec("bar", (2, 0, 0), 0, SMALL)
    with pytest.raises(UsageError, match="holds files that are not a library of bar"):
        generate_library(text, "bar.toml", tmp_path)
    assert not (tmp_path / "bar.toml").exists()


def test_empty_folders_are_no_files(tmp_path: Path) -> None:
    (tmp_path / "include" / "hamotor").mkdir(parents=True)
    library(tmp_path)
    assert (tmp_path / "include" / "hamotor" / "foo" / "foo.hpp").exists()


def test_a_file_in_the_folders_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / "foo").write_text("", encoding="utf-8")
    with pytest.raises(UsageError, match="is not a folder"):
        library(tmp_path / "foo")


@pytest.mark.parametrize(
    ("name", "signature", "null_pairs", "products", "message"),
    [
        ("2foo", (2, 0, 0), 0, None, "must match"),
        ("foo", (0, 0, 0), 0, None, "not all of them 0"),
        ("foo", (2, -1, 0), 0, None, "three numbers ≥ 0"),
        ("foo", (2, 0, 0), 1, None, "null pair"),
        ("foo", (2, 1, 0), 2, None, "the signature has 2 and 1"),
        ("foo", (5, 5, 5), 0, None, "15 dimensions; .* are allowed .* lifts the cap"),
        ("foo", (2, 0, 0), 0, ["sandwhich"], 'unknown product.*Did you mean "sandwich"'),
    ],
)
def test_what_no_algebra_can_be_is_named(
    name: str,
    signature: tuple[int, int, int],
    null_pairs: int,
    products: list[str] | None,
    message: str,
) -> None:
    with pytest.raises(UsageError, match=message):
        starter_spec(name, signature, null_pairs, products)


@pytest.mark.slow
def test_a_project_links_the_folder_as_it_is(tmp_path: Path) -> None:
    library(tmp_path / "foo", (2, 0, 1))
    (tmp_path / "main.cpp").write_text(
        '#include "hamotor/foo/foo.hpp"\n'
        "int main() {\n"
        "  constexpr hamotor::foo::Vector<int> v{2, 3, 5};\n"
        "  static_assert(gp(v, v).s == 9 + 25);\n"
        "}\n",
        encoding="utf-8",
    )
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\n"
        "project(user LANGUAGES CXX)\n"
        "add_subdirectory(foo)\n"
        "add_executable(user main.cpp)\n"
        "target_link_libraries(user PRIVATE hamotor::foo)\n",
        encoding="utf-8",
    )
    build = tmp_path / "build"
    run("cmake", "-G", "Ninja", "-S", tmp_path, "-B", build)
    run("cmake", "--build", build)
    run(build / "user")
