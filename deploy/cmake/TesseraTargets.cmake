# Target functions shared by every folder. A folder lists its sources and its dependencies; the flags live here.

# tessera_compile_options(TARGET [-O1]): -O3 where nothing else is said. Code that runs before the CPU check, and the
# check itself, must not use the instructions it checks for.
function(tessera_compile_options target)
  # -pthread everywhere: a precompiled header serves only files that are compiled with the same flags.
  target_compile_options(${target} PRIVATE -pthread -Wall -Wextra -Wno-missing-field-initializers)
  if(CMAKE_UNITY_BUILD)
    # It takes the types of a .cc file that another includes for those of a header.
    target_compile_options(${target} PRIVATE -Wno-subobject-linkage)
  endif()
  if(TESSERA_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(CMAKE_SYSTEM_PROCESSOR STREQUAL "x86_64")
    target_compile_options(${target} PRIVATE -march=x86-64-v3)
  endif()
  # Eigen sums matrix products in blocks that fit the caches it finds, which rounds in another way on another machine and
  # from there on draws other patches. One size for all machines.
  target_compile_definitions(${target} PRIVATE EIGEN_NO_CPUID EIGEN_DEFAULT_L1_CACHE_SIZE=49152
                             EIGEN_DEFAULT_L2_CACHE_SIZE=524288 EIGEN_DEFAULT_L3_CACHE_SIZE=33554432)
  if(CMAKE_BUILD_TYPE STREQUAL "Release")
    target_compile_options(${target} PRIVATE -O3 ${ARGN})
  endif()
  if(TESSERA_SANITIZE)
    # Without -fno-sanitize-recover undefined behaviour is printed, and the test passes all the same.
    target_compile_options(${target} PRIVATE -fsanitize=${TESSERA_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${TESSERA_SANITIZE})
  endif()
  if(TESSERA_SANITIZE STREQUAL "thread")
    # protobuf's headers lay out map fields in another way when they see the sanitizer, and the installed library was
    # built without it. libstdc++ must go on seeing it.
    target_compile_options(${target} PRIVATE -U__SANITIZE_THREAD__ -D_GLIBCXX_TSAN=1 -DTESSERA_THREAD_SANITIZER=1)
  endif()
endfunction()

# tessera_headers(NAME HEADERS <header>.. PRIVATE lib.. [OPTIONS -O1])
# A target whose precompiled headers others use; reading them again and again was half of the build. Files include what
# they use all the same: -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON builds without.
function(tessera_headers name)
  cmake_parse_arguments(ARG "" "" "HEADERS;PRIVATE;OPTIONS" ${ARGN})
  set(source "${CMAKE_CURRENT_BINARY_DIR}/${name}.cc")
  file(TOUCH "${source}")
  add_library(${name} OBJECT "${source}")
  target_include_directories(${name} PRIVATE "${PROJECT_SOURCE_DIR}")
  target_link_libraries(${name} PRIVATE ${ARG_PRIVATE})
  tessera_compile_options(${name} ${ARG_OPTIONS})
  target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
endfunction()

# tessera_library(NAME SOURCES a.cc.. [PUBLIC lib..] [PRIVATE lib..] [HEADERS <header>..])
# HEADERS are precompiled for this library alone, in place of tessera_btf_headers; not in a unity build, whose few files
# take less time without.
function(tessera_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE;HEADERS" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_include_directories(${name} PUBLIC "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>")
  target_link_libraries(${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  tessera_compile_options(${name})
  if(NOT ARG_HEADERS)
    target_precompile_headers(${name} REUSE_FROM tessera_btf_headers)
  elseif(NOT CMAKE_UNITY_BUILD)
    target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
  endif()
endfunction()

# tessera_executable(NAME SOURCES a.cc.. PRIVATE lib..)
function(tessera_executable name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PRIVATE" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_PRIVATE})
  tessera_compile_options(${name})
endfunction()

# tessera_test(NAME LABELS unit|gl|e2e|slow.. SOURCES a_test.cc.. PRIVATE lib.. [TIMEOUT seconds])
# One executable per folder; each TEST() is a CTest test of its own. With -O1, which compiles sooner: what takes long to run
# lies in the libraries.
function(tessera_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "LABELS;SOURCES;PRIVATE" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_PRIVATE} tessera_test_support GTest::gmock GTest::gtest_main)
  tessera_compile_options(${name} -O1)
  target_precompile_headers(${name} REUSE_FROM tessera_test_headers)
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST
                       PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT})
endfunction()

# tessera_benchmark(NAME SOURCES a_bench.cc.. PRIVATE lib..)
# Joins the target `bench`, which runs all benchmarks one after the other.
function(tessera_benchmark name)
  tessera_executable(${name} ${ARGN})
  if(NOT TARGET bench)
    add_custom_target(bench)
  endif()
  add_custom_target(run_${name} COMMAND ${name} DEPENDS ${name} USES_TERMINAL VERBATIM)
  get_property(previous GLOBAL PROPERTY TESSERA_LAST_BENCHMARK)
  if(previous)
    add_dependencies(run_${name} run_${previous})
  endif()
  set_property(GLOBAL PROPERTY TESSERA_LAST_BENCHMARK ${name})
  add_dependencies(bench run_${name})
endfunction()
