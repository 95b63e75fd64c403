# Everything that `unit` tests need, in one target: built and run under the sanitizers too.
add_custom_target(plugins)
add_custom_target(unit-tests DEPENDS plugins)

# add_node_plugin(NAME [OPENGL] SOURCES ... [LINK ...] [INCLUDE ...] [TESTS ...] [TEST_LINK ...]
#                 [BENCHMARKS ...])
#
# One folder, one shared library with one exported function. The sources are compiled once, as an
# object library, so that the plugin's own unit tests reach what the library hides. OPENGL: the
# plugin draws; it is left out where there is no OpenGL, and its tests do not count as unit tests.
function(add_node_plugin name)
  cmake_parse_arguments(P "OPENGL" "" "SOURCES;LINK;INCLUDE;TESTS;TEST_LINK;BENCHMARKS" ${ARGN})
  if(P_OPENGL AND NOT VOXLOOM_OPENGL)
    skip_node_plugin(${name} "it draws, and VOXLOOM_OPENGL is off")
    return()
  endif()

  add_library(${name}-objects OBJECT ${P_SOURCES})
  target_link_libraries(${name}-objects PUBLIC voxloom-core ${P_LINK})
  target_include_directories(${name}-objects SYSTEM PUBLIC ${P_INCLUDE})
  set_target_properties(${name}-objects PROPERTIES CXX_VISIBILITY_PRESET hidden
                        VISIBILITY_INLINES_HIDDEN ON)

  add_library(${name} MODULE)
  target_link_libraries(${name} PRIVATE ${name}-objects)
  set_target_properties(${name} PROPERTIES PREFIX "" INSTALL_RPATH "$ORIGIN/../.."
                        LIBRARY_OUTPUT_DIRECTORY ${VOXLOOM_PLUGIN_DIR})
  install(TARGETS ${name} LIBRARY DESTINATION lib/voxloom/plugins)
  set_property(GLOBAL APPEND PROPERTY VOXLOOM_PLUGINS ${name})
  add_dependencies(plugins ${name})

  if(VOXLOOM_TESTS AND P_TESTS)
    add_executable(test-${name} ${P_TESTS})
    target_link_libraries(test-${name} PRIVATE ${name}-objects voxloom-testing GTest::gtest_main
                          ${P_TEST_LINK})
    if(P_OPENGL)
      voxloom_discover_tests(test-${name} opengl)
    else()
      voxloom_discover_tests(test-${name})
    endif()
  endif()
  if(VOXLOOM_BENCHMARKS AND P_BENCHMARKS)
    add_executable(bench-${name} ${P_BENCHMARKS})
    target_link_libraries(bench-${name} PRIVATE ${name}-objects benchmark::benchmark)
  endif()
endfunction()

# Says at configure time why a plugin is not built; the rest works without it.
function(skip_node_plugin name reason)
  set_property(GLOBAL APPEND PROPERTY VOXLOOM_SKIPPED "${name}: ${reason}")
endfunction()

function(print_plugin_summary)
  get_property(built GLOBAL PROPERTY VOXLOOM_PLUGINS)
  get_property(skipped GLOBAL PROPERTY VOXLOOM_SKIPPED)
  list(JOIN built " " built)
  message(STATUS "Plugins: ${built}")
  foreach(line IN LISTS skipped)
    message(STATUS "Not built: ${line}")
  endforeach()
endfunction()

# Every test runs from the source folder, finds the built plugins, and has a time limit. `label`:
# unit (the default: no OpenGL, runs under every sanitizer) or opengl.
function(voxloom_discover_tests target)
  set(label unit)
  if(ARGC GREATER 1)
    set(label ${ARGV1})
  endif()
  if(label STREQUAL "unit")
    add_dependencies(unit-tests ${target})
  endif()
  # What is not ours, and why, stands in cmake/tsan.supp and tests/sanitizers/leaks.cpp. Memory that
  # is not there must come back as the error that tests ask for, as it does without a sanitizer.
  set(sanitizer)
  if(VOXLOOM_SANITIZE MATCHES "thread")
    set(sanitizer ENVIRONMENT_MODIFICATION
        "TSAN_OPTIONS=set:suppressions=${PROJECT_SOURCE_DIR}/cmake/tsan.supp:allocator_may_return_null=1")
  elseif(VOXLOOM_SANITIZE MATCHES "address")
    set(sanitizer ENVIRONMENT_MODIFICATION
        "ASAN_OPTIONS=set:allocator_may_return_null=1")
  endif()
  gtest_discover_tests(${target} WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
    DISCOVERY_TIMEOUT 60 TEST_PREFIX "${target}."
    PROPERTIES LABELS ${label} TIMEOUT 300 ENVIRONMENT "VOXLOOM_PLUGIN_PATH=${VOXLOOM_PLUGIN_DIR}"
               ${sanitizer})
endfunction()
