# What `cmake --install` puts where.
#   component runtime   bin/tessera (server/ installs its own program)
#   component sdk       libraries, headers, tessera.proto and the package that find_package(tessera) reads
# Headers lie under include/tessera in the tree's own folders; both include and include/tessera are searched, so that
# <tessera/client/lib/client.h> works outside and "btf/wang/dressing.h" works inside.
include(CMakePackageConfigHelpers)

install(TARGETS tessera RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}" COMPONENT runtime)

set(sdk base cpu_features math container wang proto wire client)
foreach(name IN LISTS sdk)
  set_target_properties(tessera_${name} PROPERTIES EXPORT_NAME ${name})
endforeach()
list(TRANSFORM sdk PREPEND tessera_)
install(TARGETS ${sdk} EXPORT tesseraTargets
        ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT sdk
        INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" "${CMAKE_INSTALL_INCLUDEDIR}/tessera")

set(include_dir "${CMAKE_INSTALL_INCLUDEDIR}/tessera")
foreach(folder btf/base btf/math btf/codec btf/wang proto/wire client/lib)
  # Not the encoders, the server's conversions and what is private to a folder.
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/${folder}/" DESTINATION "${include_dir}/${folder}" COMPONENT sdk
          FILES_MATCHING PATTERN "*.h"
          PATTERN "codec.h" EXCLUDE PATTERN "quantize.h" EXCLUDE PATTERN "dsh" EXCLUDE PATTERN "parallel.h" EXCLUDE
          PATTERN "convert.h" EXCLUDE PATTERN "*stubs.h" EXCLUDE PATTERN "backoff.h" EXCLUDE)
endforeach()
install(FILES "${PROJECT_SOURCE_DIR}/btf/data/btf_source.h" DESTINATION "${include_dir}/btf/data" COMPONENT sdk)
install(FILES "${PROJECT_SOURCE_DIR}/btf/image/image.h" DESTINATION "${include_dir}/btf/image" COMPONENT sdk)
install(FILES "${PROJECT_BINARY_DIR}/proto/tessera/v1/tessera.pb.h" "${PROJECT_BINARY_DIR}/proto/tessera/v1/tessera.grpc.pb.h"
        DESTINATION "${include_dir}/v1" COMPONENT sdk)
install(FILES "${PROJECT_SOURCE_DIR}/proto/tessera/v1/tessera.proto"
        DESTINATION "${CMAKE_INSTALL_DATADIR}/tessera/proto/tessera/v1" COMPONENT sdk)

set(package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/tessera")
install(EXPORT tesseraTargets NAMESPACE tessera:: DESTINATION "${package_dir}" COMPONENT sdk)
configure_package_config_file("${CMAKE_CURRENT_LIST_DIR}/tesseraConfig.cmake.in" "${PROJECT_BINARY_DIR}/tesseraConfig.cmake"
                              INSTALL_DESTINATION "${package_dir}")
write_basic_package_version_file("${PROJECT_BINARY_DIR}/tesseraConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/tesseraConfig.cmake" "${PROJECT_BINARY_DIR}/tesseraConfigVersion.cmake"
        DESTINATION "${package_dir}" COMPONENT sdk)
