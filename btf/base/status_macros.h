// Propagation of absl::Status, in the two forms the code base uses.
#pragma once

#include <utility>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#define TESSERA_CONCAT_INNER(a, b) a##b
#define TESSERA_CONCAT(a, b) TESSERA_CONCAT_INNER(a, b)

// Returns from the calling function when `expression` is not OK.
#define TESSERA_RETURN_IF_ERROR(expression)                   \
  do {                                                        \
    if (absl::Status status_ = (expression); !status_.ok()) { \
      return status_;                                         \
    }                                                         \
  } while (false)

// Evaluates a StatusOr; assigns its value to `lhs` or returns its status.
#define TESSERA_ASSIGN_OR_RETURN(lhs, expression) \
  TESSERA_ASSIGN_OR_RETURN_INNER(TESSERA_CONCAT(status_or_, __LINE__), lhs, expression)
#define TESSERA_ASSIGN_OR_RETURN_INNER(name, lhs, expression) \
  auto name = (expression);                                   \
  if (!name.ok()) {                                           \
    return name.status();                                     \
  }                                                           \
  lhs = *std::move(name)
