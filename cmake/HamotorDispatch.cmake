# hamotor_dispatch(TARGET SOURCES FILE... FUNCTIONS NAME...)
#
# Compiles sources once for each of several instruction sets, all into TARGET, and chooses among
# them when the program starts (or the shared library is loaded): one binary for every processor of
# the architecture, as fast as one that is compiled where it runs, and with the same bits on all.
#
# SOURCES    with TARGET's include directories, definitions and options; std::vector and whatever
#            else is inline stays apart in each
# FUNCTIONS  the extern "C" functions by which they are entered; all else in them is hidden
#
# On x86-64 the sets are avx512, avx2 (with fused multiply-adds) and sse2, which every processor
# has; fused multiply-adds are the C library's there.  The environment variable HAMOTOR_ISA forces
# a lower one.  hamotor::instruction_set says in each what it is compiled for.  Other architectures
# have one set, and the sources are compiled as usual.
#
# Needs GNU's linker and objcopy on x86-64; link-time optimisation is off for SOURCES.

include_guard(GLOBAL)

# With the options for the compilers, and what __builtin_cpu_supports has to find for it.
macro(hamotor_instruction_sets)
  set(HAMOTOR_ISA_sse2_OPTIONS "")
  set(HAMOTOR_ISA_sse2_FEATURES "")
  set(HAMOTOR_ISA_avx2_OPTIONS -mavx2 -mfma -mbmi -mbmi2)
  set(HAMOTOR_ISA_avx2_FEATURES avx2 fma bmi bmi2)
  set(HAMOTOR_ISA_avx512_OPTIONS ${HAMOTOR_ISA_avx2_OPTIONS} -mavx512f -mavx512cd -mavx512bw
                                 -mavx512dq -mavx512vl)
  set(HAMOTOR_ISA_avx512_FEATURES ${HAMOTOR_ISA_avx2_FEATURES} avx512f avx512cd avx512bw avx512dq
                                  avx512vl)
endmacro()

function(hamotor_dispatch target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;FUNCTIONS")
  set(here "hamotor_dispatch(${target})")
  if(NOT TARGET ${target})
    message(FATAL_ERROR "${here}: there is no such target; add it before")
  endif()
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "${here}: unknown arguments: ${arg_UNPARSED_ARGUMENTS}; "
                        "allowed are SOURCES and FUNCTIONS")
  endif()
  if(NOT arg_SOURCES OR NOT arg_FUNCTIONS)
    message(FATAL_ERROR "${here}: give SOURCES FILE... and FUNCTIONS NAME...")
  endif()
  foreach(function IN LISTS arg_FUNCTIONS)
    if(NOT function MATCHES "^[A-Za-z_][A-Za-z0-9_]*$")
      message(FATAL_ERROR "${here}: \"${function}\" is not the name of an extern \"C\" function")
    endif()
  endforeach()
  target_compile_definitions(${target} PRIVATE HAMOTOR_FUSED)
  if(NOT CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|amd64)$")
    target_sources(${target} PRIVATE ${arg_SOURCES})
    return()
  endif()
  if(NOT CMAKE_OBJCOPY OR NOT CMAKE_EXECUTABLE_FORMAT STREQUAL "ELF")
    message(FATAL_ERROR "${here}: needs ELF and objcopy (Debian: binutils)")
  endif()

  hamotor_instruction_sets()
  set(folder "${CMAKE_CURRENT_BINARY_DIR}/hamotor_dispatch/${target}")
  foreach(isa sse2 avx2 avx512)
    set(objects ${target}_${isa})
    add_library(${objects} OBJECT ${arg_SOURCES})
    set_target_properties(${objects} PROPERTIES POSITION_INDEPENDENT_CODE ON
                                                INTERPROCEDURAL_OPTIMIZATION OFF)
    foreach(property INCLUDE_DIRECTORIES COMPILE_DEFINITIONS COMPILE_OPTIONS COMPILE_FEATURES)
      set_property(TARGET ${objects} PROPERTY ${property}
                                              "$<TARGET_PROPERTY:${target},${property}>")
    endforeach()
    # After the target's own, which may name a processor.
    target_compile_options(
      ${objects} PRIVATE -march=x86-64 ${HAMOTOR_ISA_${isa}_OPTIONS}
                         $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)

    # Inline functions are the same by name and not by instructions: the linker would take any.
    set(joined "${folder}/${isa}-joined.o")
    set(hidden "${folder}/${isa}.o")
    set(kept "")
    set(renamed "")
    foreach(function IN LISTS arg_FUNCTIONS)
      list(APPEND kept "--keep-global-symbol=${function}")
      list(APPEND renamed "--redefine-sym=${function}=${function}_${isa}")
    endforeach()
    add_custom_command(
      OUTPUT "${hidden}"
      COMMAND "${CMAKE_COMMAND}" -E make_directory "${folder}"
      COMMAND "${CMAKE_CXX_COMPILER}" -r -nostdlib -Wl,--force-group-allocation -o "${joined}"
              $<TARGET_OBJECTS:${objects}>
      COMMAND "${CMAKE_OBJCOPY}" ${kept} "${joined}"
      COMMAND "${CMAKE_OBJCOPY}" ${renamed} "${joined}" "${hidden}"
      DEPENDS ${objects} $<TARGET_OBJECTS:${objects}>
      COMMENT "Hiding all but the functions of ${target} for ${isa}"
      COMMAND_EXPAND_LISTS VERBATIM)
    target_sources(${target} PRIVATE "${hidden}")
    set_source_files_properties("${hidden}" PROPERTIES EXTERNAL_OBJECT ON GENERATED ON)
  endforeach()
  hamotor_dispatcher("${folder}/dispatcher.cpp" ${arg_FUNCTIONS})
  target_sources(${target} PRIVATE "${folder}/dispatcher.cpp")
endfunction()

# The file that chooses: a jump for each function, whatever its arguments are.
function(hamotor_dispatcher file)
  set(sets "")
  foreach(isa sse2 avx2 avx512)
    set(condition "")
    foreach(feature IN LISTS HAMOTOR_ISA_${isa}_FEATURES)
      string(APPEND condition " && __builtin_cpu_supports(\"${feature}\")")
    endforeach()
    string(APPEND sets "      {\"${isa}\", true${condition}},\n")
  endforeach()
  set(functions "")
  set(choices "")
  foreach(function IN LISTS ARGN)
    string(APPEND functions "HAMOTOR_FUNCTION(${function})\n")
    string(APPEND choices "  hamotor_${function}_chosen = hamotor_${function}_all[chosen];\n")
  endforeach()
  set(text [=[
// Written by hamotor_dispatch.
#include <cstdio>
#include <cstdlib>
#include <cstring>

// Until a set is chosen, before any other initialisation, it is the one that all processors have.
#define HAMOTOR_HIDDEN extern "C" [[gnu::visibility("hidden")]]
#define HAMOTOR_FUNCTION(name)                                                               \
  HAMOTOR_HIDDEN void name##_sse2();                                                         \
  HAMOTOR_HIDDEN void name##_avx2();                                                         \
  HAMOTOR_HIDDEN void name##_avx512();                                                       \
  HAMOTOR_HIDDEN void (*hamotor_##name##_chosen)();                                          \
  void (*hamotor_##name##_chosen)() = name##_sse2;                                           \
  static void (*const hamotor_##name##_all[])() = {name##_sse2, name##_avx2, name##_avx512}; \
  asm(".text\n.p2align 4\n.globl " #name "\n.type " #name ", @function\n" #name              \
      ":\n  endbr64\n  jmp *hamotor_" #name "_chosen(%rip)\n.size " #name ", .-" #name "\n");
@functions@
namespace {

[[gnu::constructor(101)]] void choose() {
  __builtin_cpu_init();
  const struct {
    const char* name;
    bool there;
  } sets[] = {
@sets@  };
  int chosen = sets[2].there ? 2 : sets[1].there ? 1 : 0;
  if (const char* forced = std::getenv("HAMOTOR_ISA"); forced != nullptr && *forced != '\0') {
    int wanted = chosen;
    while (wanted >= 0 && std::strcmp(sets[wanted].name, forced) != 0) --wanted;
    if (wanted < 0) {
      std::fprintf(stderr, "HAMOTOR_ISA is \"%s\"; this processor has", forced);
      for (int k = 0; k <= chosen; ++k) std::fprintf(stderr, " %s", sets[k].name);
      std::fputs(".\n", stderr);
      std::_Exit(2);
    }
    chosen = wanted;
  }
@choices@}

}  // namespace
]=])
  file(CONFIGURE OUTPUT "${file}" CONTENT "${text}" @ONLY)
endfunction()
