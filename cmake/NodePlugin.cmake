# add_node_plugin(NAME SOURCES ... [LINK ...] [INCLUDE ...] [TESTS ...] [TEST_LINK ...] [BENCHMARKS ...])
#
# One folder, one shared library with one exported function. The sources are compiled once, as an
# object library, so that the plugin's own unit tests reach what the library hides.
function(add_node_plugin name)
  cmake_parse_arguments(P "" "" "SOURCES;LINK;INCLUDE;TESTS;TEST_LINK;BENCHMARKS" ${ARGN})

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

  if(VOXLOOM_TESTS AND P_TESTS)
    add_executable(test-${name} ${P_TESTS})
    target_link_libraries(test-${name} PRIVATE ${name}-objects voxloom-testing GTest::gtest_main
                          ${P_TEST_LINK})
    voxloom_discover_tests(test-${name})
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

# Every test runs from the source folder, finds the built plugins, and has a time limit.
function(voxloom_discover_tests target)
  gtest_discover_tests(${target} WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
    DISCOVERY_TIMEOUT 60 TEST_PREFIX "${target}."
    PROPERTIES TIMEOUT 300 ENVIRONMENT "VOXLOOM_PLUGIN_PATH=${VOXLOOM_PLUGIN_DIR}")
endfunction()
