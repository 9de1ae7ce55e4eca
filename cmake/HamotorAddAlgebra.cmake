# hamotor_add_algebra(NAME SIGNATURE P Q R [NULL_PAIRS N] [KERNELS KERNEL...] [TEST])
# hamotor_add_algebra(NAME SPEC FILE [TEST])
#
# Generates an algebra's kernels in the build tree when something that links them is built, and
# again when the spec or the generator changes.  Gives the target hamotor::NAME; its headers are
# hamotor/NAME/NAME.hpp and its parts, in the namespace hamotor::NAME.
#
# SIGNATURE  numbers of positive, negative and null basis vectors; NULL_PAIRS as many pairs of a
#            positive and a negative vector become null vectors with product -1
# KERNELS    what is wanted (default: all but dexp): operations (gp, sandwich, dexp, ...) for the
#            operands that come with them, or requests as in a spec ("gp Even Vector -> Odd");
#            element types are those that `hamotor new algebra --signature P,Q,R` prints
# SPEC       a spec file (`hamotor new algebra` prints one); its name must be NAME
# TEST       also builds NAME_kernels, which compares every kernel with products by table, and
#            adds it to CTest
#
# HAMOTOR_EXECUTABLE is the generator: by default the `hamotor` of the source tree that this file
# belongs to, or else the one on the PATH.

include_guard(GLOBAL)

function(hamotor_add_algebra name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "TEST" "NULL_PAIRS;SPEC" "SIGNATURE;KERNELS")
  set(here "hamotor_add_algebra(${name})")
  if(NOT name MATCHES "^[A-Za-z][A-Za-z0-9_]*$")
    message(FATAL_ERROR "${here}: the name must match [A-Za-z][A-Za-z0-9_]*")
  endif()
  if(TARGET hamotor::${name})
    message(FATAL_ERROR "${here}: there is a target hamotor::${name} already")
  endif()
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "${here}: unknown arguments: ${arg_UNPARSED_ARGUMENTS}; "
                        "allowed are SIGNATURE, NULL_PAIRS, KERNELS, SPEC and TEST")
  endif()
  if(arg_KEYWORDS_MISSING_VALUES)
    message(FATAL_ERROR "${here}: no value for ${arg_KEYWORDS_MISSING_VALUES}")
  endif()
  if(DEFINED arg_SPEC EQUAL DEFINED arg_SIGNATURE)
    message(FATAL_ERROR "${here}: give either SIGNATURE P Q R or SPEC FILE")
  endif()

  if(DEFINED arg_SPEC)
    if(DEFINED arg_NULL_PAIRS OR DEFINED arg_KERNELS)
      message(FATAL_ERROR "${here}: NULL_PAIRS and KERNELS go with SIGNATURE; "
                          "a SPEC says these itself")
    endif()
    cmake_path(ABSOLUTE_PATH arg_SPEC BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE)
    if(NOT EXISTS "${arg_SPEC}")
      message(FATAL_ERROR "${here}: no such file: ${arg_SPEC}")
    endif()
    file(STRINGS "${arg_SPEC}" named REGEX "^[ \t]*name[ \t]*=" LIMIT_COUNT 1)
    string(REGEX REPLACE "^[^=]*=[ \t]*[\"']([^\"']*)[\"'].*" "\\1" named "${named}")
    if(NOT named STREQUAL name)
      message(FATAL_ERROR "${here}: ${arg_SPEC} is the spec of \"${named}\"; "
                          "call hamotor_add_algebra(${named} ...) or rename it there")
    endif()
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${arg_SPEC}")
    set(what --spec "${arg_SPEC}")
  else()
    list(LENGTH arg_SIGNATURE count)
    if(NOT count EQUAL 3 OR NOT "${arg_SIGNATURE}" MATCHES "^[0-9]+;[0-9]+;[0-9]+$")
      message(FATAL_ERROR "${here}: SIGNATURE needs three whole numbers P Q R, "
                          "not \"${arg_SIGNATURE}\"")
    endif()
    list(JOIN arg_SIGNATURE "," signature)
    set(what --signature "${signature}" --name "${name}")
    if(DEFINED arg_NULL_PAIRS)
      list(APPEND what --null-pairs "${arg_NULL_PAIRS}")
    endif()
    if(DEFINED arg_KERNELS)
      list(JOIN arg_KERNELS "," kernels)
      list(APPEND what --products "${kernels}")
    endif()
  endif()

  set(source_tree "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/..")
  cmake_path(NORMAL_PATH source_tree)
  find_program(HAMOTOR_EXECUTABLE hamotor HINTS "${source_tree}"
               DOC "The generator that hamotor_add_algebra calls")
  if(NOT HAMOTOR_EXECUTABLE)
    message(FATAL_ERROR "${here}: no generator found. Set -DHAMOTOR_EXECUTABLE=PATH to the "
                        "`hamotor` of a Hamotor source tree, or generate the folder once with "
                        "`hamotor generate --out DIR` and use add_subdirectory(DIR)")
  endif()
  if(NOT EXISTS "${HAMOTOR_EXECUTABLE}")
    message(FATAL_ERROR "${here}: HAMOTOR_EXECUTABLE is \"${HAMOTOR_EXECUTABLE}\", "
                        "and there is no such file")
  endif()

  # What the text depends on besides the spec: the generator, where its source can be seen.
  file(REAL_PATH "${HAMOTOR_EXECUTABLE}" executable)
  cmake_path(GET executable PARENT_PATH root)
  file(GLOB generator CONFIGURE_DEPENDS
       "${root}/generator/hamotor/*.py" "${root}/generator/hamotor/codegen/*.py"
       "${root}/generator/algebras/*.toml" "${root}/templates/*.jinja"
       "${root}/runtime/include/hamotor/*.hpp" "${root}/requirements.lock"
       "${root}/.clang-format")

  set(folder "${CMAKE_CURRENT_BINARY_DIR}/hamotor_algebras/${name}")
  set(header "${folder}/include/hamotor/${name}/${name}.hpp")
  set(elements "${folder}/include/hamotor/${name}/elements.hpp")
  set(test "${folder}/test/${name}_test.cpp")
  # All functions of the algebra come with its elements: by them what includes any is compiled again,
  # also where Ninja does not know which headers there are.
  add_custom_command(
    OUTPUT "${elements}"
    BYPRODUCTS "${header}" "${test}"
    COMMAND "${HAMOTOR_EXECUTABLE}" generate ${what} --out "${folder}"
    COMMAND "${CMAKE_COMMAND}" -E touch "${elements}"
    DEPENDS ${arg_SPEC} "${executable}" ${generator}
    COMMENT "Generating the algebra ${name}"
    VERBATIM)
  add_custom_target(hamotor_generate_${name} DEPENDS "${elements}")

  add_library(hamotor_algebra_${name} INTERFACE)
  add_library(hamotor::${name} ALIAS hamotor_algebra_${name})
  add_dependencies(hamotor_algebra_${name} hamotor_generate_${name})
  target_include_directories(hamotor_algebra_${name} INTERFACE "${folder}/include")
  target_compile_features(hamotor_algebra_${name} INTERFACE cxx_std_20)
  # Multiply-adds are written out, in a fixed order; a compiler that fuses more changes the bits.
  target_compile_options(hamotor_algebra_${name}
                         INTERFACE $<$<CXX_COMPILER_ID:GNU,Clang,AppleClang>:-ffp-contract=off>)

  if(arg_TEST)
    set_source_files_properties("${test}" PROPERTIES GENERATED TRUE)
    add_executable(${name}_kernels "${test}")
    target_link_libraries(${name}_kernels PRIVATE hamotor::${name})
    add_test(NAME ${name}_kernels_equal_products_by_table COMMAND ${name}_kernels)
  endif()
endfunction()
