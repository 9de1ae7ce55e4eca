# hamotor_dispatch(TARGET SOURCES FILE... FUNCTIONS NAME...)
#
# Compiles sources once for each of several instruction sets, all into TARGET, and chooses among
# them when the program starts (or the shared library is loaded): one binary for every processor of
# the architecture, as fast as one that is compiled where it runs, and with the same bits on all.
#
# SOURCES    compiled as TARGET's own, with its libraries, options and language, also those that are
#            given to it later; std::vector and whatever else is inline stays apart in each
# FUNCTIONS  the extern "C" functions by which they are entered; all else in them is hidden
#
# A target may have several calls, with a function in one of them.
#
# On x86-64 the sets are avx512, avx2 (with fused multiply-adds) and sse2, which every processor
# has; fused multiply-adds are the C library's there.  The environment variable HAMOTOR_ISA forces
# a lower one.  hamotor::instruction_set says in each what it is compiled for.  Other architectures
# have one set, and the sources are compiled as usual.
#
# Needs GNU's linker and objcopy on x86-64; link-time optimisation, unity builds and what
# the project says of processors (-march=native, -mavx2) are off for SOURCES.

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
  get_target_property(type ${target} TYPE)
  if(NOT type MATCHES "^(EXECUTABLE|(STATIC|SHARED|MODULE)_LIBRARY)$")
    message(FATAL_ERROR "${here}: a target of type ${type}; allowed are executables and static, "
                        "shared and module libraries")
  endif()
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "${here}: unknown arguments: ${arg_UNPARSED_ARGUMENTS}; "
                        "allowed are SOURCES and FUNCTIONS")
  endif()
  if(NOT arg_SOURCES OR NOT arg_FUNCTIONS)
    message(FATAL_ERROR "${here}: give SOURCES FILE... and FUNCTIONS NAME...")
  endif()
  get_target_property(dispatched ${target} HAMOTOR_DISPATCHED)
  if(NOT dispatched)
    set(dispatched "")
  endif()
  foreach(function IN LISTS arg_FUNCTIONS)
    if(NOT function MATCHES "^[A-Za-z_][A-Za-z0-9_]*$")
      message(FATAL_ERROR "${here}: \"${function}\" is not the name of an extern \"C\" function")
    endif()
    if(function IN_LIST dispatched)
      message(FATAL_ERROR "${here}: \"${function}\" is listed twice; each function is entered in "
                          "one place")
    endif()
    list(APPEND dispatched ${function})
  endforeach()
  get_target_property(base ${target} SOURCE_DIR)
  set(others "")
  get_property(sources TARGET ${target} PROPERTY SOURCES)
  foreach(source IN LISTS sources)
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY "${base}" NORMALIZE)
    list(APPEND others "${source}")
  endforeach()
  foreach(source IN LISTS arg_SOURCES)
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE
               OUTPUT_VARIABLE path)
    if(path IN_LIST others)
      message(FATAL_ERROR "${here}: ${source} is among the target's other sources, too, and would "
                          "be compiled for one processor there; leave it out there")
    endif()
  endforeach()
  target_compile_definitions(${target} PRIVATE HAMOTOR_FUSED)
  set_property(TARGET ${target} PROPERTY HAMOTOR_DISPATCHED ${dispatched})
  if(NOT CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|amd64)$")
    target_sources(${target} PRIVATE ${arg_SOURCES})
    return()
  endif()
  if(NOT CMAKE_OBJCOPY OR NOT CMAKE_EXECUTABLE_FORMAT STREQUAL "ELF")
    message(FATAL_ERROR "${here}: needs ELF and objcopy (Debian: binutils)")
  endif()

  hamotor_instruction_sets()
  # Nothing of what the project's options say of processors, -mno-sse3 including all AVX; and what is
  # bytecode has no symbols to hide.
  set(bare -march=x86-64 -mno-sse3 -mno-popcnt -mno-lzcnt -mno-bmi -mno-bmi2 -fno-lto
           $<$<COMPILE_LANG_AND_ID:CXX,Clang>:-fno-whole-program-vtables>)
  # A target may have several calls; they are known by their first functions.
  list(GET arg_FUNCTIONS 0 first)
  set(parts ${target}_${first})
  set(folder "${CMAKE_CURRENT_BINARY_DIR}/hamotor_dispatch/${parts}")
  hamotor_dispatcher("${folder}/dispatcher.cpp" ${arg_FUNCTIONS})
  # Its own library: neither warnings nor optimisation of the target are for what is written here.
  add_library(${parts}_dispatcher OBJECT EXCLUDE_FROM_ALL "${folder}/dispatcher.cpp")
  target_compile_features(${parts}_dispatcher PRIVATE cxx_std_17)
  target_compile_options(${parts}_dispatcher PRIVATE -w -masm=att ${bare})
  set_target_properties(${parts}_dispatcher PROPERTIES POSITION_INDEPENDENT_CODE ON
                                                       INTERPROCEDURAL_OPTIMIZATION OFF
                                                       CXX_CLANG_TIDY "")

  # Sources that are generated are generated once, and not by each library.
  add_custom_target(${parts}_sources DEPENDS ${arg_SOURCES})
  set(all_hidden "")
  foreach(isa sse2 avx2 avx512)
    set(objects ${parts}_${isa})
    add_library(${objects} OBJECT EXCLUDE_FROM_ALL ${arg_SOURCES})
    add_dependencies(${objects} ${parts}_sources)
    set_target_properties(${objects} PROPERTIES POSITION_INDEPENDENT_CODE ON UNITY_BUILD OFF
                                                INTERPROCEDURAL_OPTIMIZATION OFF)
    # Linked last, so that its options come after all others; in one, as CMake drops what it has seen.
    # Nobody can put functions of his own in place of what is hidden.
    add_library(${objects}_options INTERFACE)
    string(JOIN " " options ${bare} ${HAMOTOR_ISA_${isa}_OPTIONS} -fno-semantic-interposition
                            $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-fno-gnu-unique>)
    target_compile_options(${objects}_options INTERFACE "SHELL:${options}")
    foreach(property INCLUDE_DIRECTORIES COMPILE_DEFINITIONS COMPILE_OPTIONS COMPILE_FEATURES
                     LINK_LIBRARIES PRECOMPILE_HEADERS)
      set_property(TARGET ${objects} PROPERTY ${property}
                                              "$<TARGET_PROPERTY:${target},${property}>")
    endforeach()
    target_link_libraries(${objects} PRIVATE ${objects}_options)

    # Inline functions are the same by name and not by instructions: the linker would take any.
    set(joined "${folder}/${isa}-$<CONFIG>-joined.o")
    set(hidden "${folder}/${isa}-$<CONFIG>.o")
    set(compiled "$<FILTER:$<TARGET_OBJECTS:${objects}>,EXCLUDE,\\.[gp]ch$>")
    set(required "")
    set(kept "")
    set(renamed "")
    foreach(function IN LISTS arg_FUNCTIONS)
      list(APPEND required "-Wl,--require-defined=${function}")
      list(APPEND kept "--keep-global-symbol=${function}")
      list(APPEND renamed "--redefine-sym=${function}=${function}_${isa}")
    endforeach()
    add_custom_command(
      OUTPUT "${hidden}"
      COMMAND "${CMAKE_CXX_COMPILER}" -r -nostdlib -Wl,--force-group-allocation ${required} -o
              "${joined}" "${compiled}"
      COMMAND "${CMAKE_OBJCOPY}" ${kept} "${joined}"
      COMMAND "${CMAKE_OBJCOPY}" ${renamed} "${joined}" "${hidden}"
      # The dispatcher, since it changes with the functions.
      DEPENDS ${objects} "${compiled}" "${folder}/dispatcher.cpp"
      COMMENT "Hiding all but the functions of ${target} for ${isa}"
      COMMAND_EXPAND_LISTS VERBATIM)
    list(APPEND all_hidden "${hidden}")
  endforeach()
  target_sources(${target} PRIVATE ${all_hidden} $<TARGET_OBJECTS:${parts}_dispatcher>)
  # A target of another folder does not know the commands of this one.
  add_custom_target(${parts} DEPENDS ${all_hidden})
  add_dependencies(${parts}_dispatcher ${parts})

  # What generator expressions do not pass on, once all is said about the target.
  foreach(isa sse2 avx2 avx512)
    cmake_language(EVAL CODE "cmake_language(DEFER DIRECTORY [[${CMAKE_SOURCE_DIR}]] CALL
                              hamotor_compile_alike ${target} ${parts}_${isa})")
  endforeach()
endfunction()

function(hamotor_compile_alike target objects)
  set(properties VISIBILITY_INLINES_HIDDEN)
  foreach(language C CXX)
    foreach(property STANDARD STANDARD_REQUIRED EXTENSIONS VISIBILITY_PRESET)
      list(APPEND properties ${language}_${property})
    endforeach()
  endforeach()
  foreach(property IN LISTS properties)
    get_property(value TARGET ${target} PROPERTY ${property})
    set_property(TARGET ${objects} PROPERTY ${property} ${value})
  endforeach()
  get_target_property(dependencies ${target} MANUALLY_ADDED_DEPENDENCIES)
  if(dependencies)
    add_dependencies(${objects} ${dependencies})
  endif()
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
  asm(".pushsection .text\n.p2align 4\n.globl " #name "\n.type " #name ", @function\n"       \
      #name ":\n  endbr64\n  jmp *hamotor_" #name "_chosen(%rip)\n"                          \
      ".size " #name ", .-" #name "\n.popsection\n");
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
