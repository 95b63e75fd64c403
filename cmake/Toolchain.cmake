# Language, warnings, sanitizers and output folders: what every target shares.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()

find_program(CCACHE ccache)
if(CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${CCACHE})
endif()

# bin/voxloom finds its plugins in ../lib/voxloom/plugins, in the build tree as after `cmake --install`.
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
set(CMAKE_LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)
set(VOXLOOM_PLUGIN_DIR ${PROJECT_BINARY_DIR}/lib/voxloom/plugins)

add_library(voxloom-options INTERFACE)
target_include_directories(voxloom-options INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_options(voxloom-options INTERFACE -Wall -Wextra -Wpedantic -Wshadow
                       -Wnon-virtual-dtor -Woverloaded-virtual -Wcast-qual)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC 12 warns about std::string's own operator+ (its bug 105651).
  target_compile_options(voxloom-options INTERFACE -Wno-restrict)
endif()
if(VOXLOOM_WERROR)
  target_compile_options(voxloom-options INTERFACE -Werror)
endif()
if(VOXLOOM_SANITIZE)
  target_compile_options(voxloom-options INTERFACE -fsanitize=${VOXLOOM_SANITIZE}
                         -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(voxloom-options INTERFACE -fsanitize=${VOXLOOM_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # GCC's -O2 diagnostics are unreliable on instrumented code.
    target_compile_options(voxloom-options INTERFACE -Wno-maybe-uninitialized -Wno-restrict
                           -Wno-stringop-overflow -Wno-array-bounds)
  endif()
endif()
if(VOXLOOM_FUZZ)
  # Coverage of everything, for libFuzzer to steer by; the targets themselves link its main().
  target_compile_options(voxloom-options INTERFACE -fsanitize=fuzzer-no-link)
endif()
