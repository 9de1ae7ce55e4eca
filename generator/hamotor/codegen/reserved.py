"""Names that generated C++ cannot take, whatever the spec calls its things.

One rule for each kind of name keeps most of them apart: types begin with a capital, everything else
with a small letter.  What is left is listed here; a test holds the lists against the identifiers of
the templates and the runtime and against the compilers' macros.
"""

from __future__ import annotations

import re


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


KEYWORDS = _words(
    """alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t
    char32_t class compl concept const consteval constexpr constinit const_cast continue co_await
    co_return co_yield decltype default delete do double dynamic_cast else enum explicit export
    extern false float for friend goto if inline int long mutable namespace new noexcept not not_eq
    nullptr operator or or_eq private protected public register reinterpret_cast requires return
    short signed sizeof static static_assert static_cast struct switch template this thread_local
    throw true try typedef typeid typename union unsigned using virtual void volatile wchar_t while
    xor xor_eq"""
)
"""C++20's keywords and alternative tokens."""

MACROS = _words(
    """alloca assert be16toh be32toh be64toh errno htobe16 htobe32 htobe64 htole16 htole32 htole64
    issubnormal le16toh le32toh le64toh linux math_errhandling offsetof stderr stdin stdout strdupa
    strndupa unix va_arg va_copy va_end va_start"""
)
"""What compilers and the standard library's headers define, in small letters."""

CAPITAL_MACROS = re.compile(
    r"E[A-Z0-9]{2,}|W[A-Z]{3,}|SNAN\w*|NAN|NULL|BUFSIZ|INFINITY|NFDBITS|MAXFLOAT|OVERFLOW"
    r"|UNDERFLOW|DOMAIN|SING|PLOSS|TLOSS|HUGE"
)
"""The same without a small letter or an underscore."""

VOCABULARY = _words("dot hamotor mul_add scalar select std")
"""What the body of a kernel refers to."""

MEMBERS = _words("cast components from identity names size")
"""Members of every element type."""

RUNTIME = _words(
    """detail generic has_fused_multiply_add inertia less less_product onto scene scene_abi space_of
    test all any clean install help package package_source edit_cache rebuild_cache
    list_install_components elements kernels"""
)
"""What else an algebra cannot be called: names in the namespace hamotor, CMake targets, files."""

GROUP_MEMBERS = _words("algebra dimension generators log name cayley_inverse")
"""Members of a group's tag."""

GROUP_FILES = frozenset(("elements", "kernels", "detail", "generic"))
TYPES = frozenset(("Rate", "Momentum", "Element"))
"""Types that every group has."""

_SMALL = re.compile(r"[a-z](?:_?[A-Za-z0-9])*\Z")
_TYPE = re.compile(r"[A-Z][A-Za-z0-9]*[a-z][A-Za-z0-9]*\Z")
_GROUP = re.compile(r"[A-Z][A-Za-z0-9]*\Z")


def small(name: str) -> str:
    """Why a parameter or a coordinate cannot have this name; empty where it can."""
    if not _SMALL.match(name):
        return "must be letters, digits and single underscores, the first a small letter"
    if name in KEYWORDS:
        return "is a keyword of C++"
    if name in MACROS:
        return "is a macro of the C library"
    if name in VOCABULARY or name in MEMBERS:
        return "is a name that generated code uses itself"
    return ""


def algebra(name: str) -> str:
    """Why an algebra cannot have this name."""
    if reason := small(name):
        return reason
    return "is a name of Hamotor's runtime or build" if name in RUNTIME else ""


def element(name: str) -> str:
    """Why an element type cannot have this name."""
    if not _TYPE.match(name):
        return "must be letters and digits, the first a capital and another one small"
    return "is a type that every group has" if name in TYPES else ""


def group(name: str, functions: frozenset[str]) -> str:
    """Why a group cannot have this name, which in small letters is a namespace."""
    if not _GROUP.match(name):
        return "must be letters and digits, the first a capital"
    if name in TYPES or CAPITAL_MACROS.fullmatch(name) or len(name) == 1:
        return "is a name that generated code or the C library uses itself"
    namespace = name.lower()
    if reason := small(namespace):
        return f"is the namespace {namespace}, which {reason}"
    if namespace in functions | GROUP_MEMBERS | GROUP_FILES:
        return f"is the namespace {namespace}, which is a function, a member or a file already"
    return ""
