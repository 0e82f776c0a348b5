# Targets `format` (rewrites) and `check_format` (fails on a difference) over every source file git knows.
find_program(CLANG_FORMAT clang-format)
set(list_sources "git ls-files --cached --others --exclude-standard -- '*.h' '*.cc'")
if(CLANG_FORMAT)
  add_custom_target(format
    COMMAND sh -c "${list_sources} | xargs ${CLANG_FORMAT} -i"
    WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}" VERBATIM)
  add_custom_target(check_format
    COMMAND sh -c "${list_sources} | xargs ${CLANG_FORMAT} --dry-run -Werror"
    WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}" VERBATIM)
endif()
