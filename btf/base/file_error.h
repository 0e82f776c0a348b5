// Failed system calls on files, as statuses.
#pragma once

#include <string>
#include <string_view>

#include <absl/status/status.h>

namespace tessera {

// "NAME: WHAT: what errno says", for example "a.png: cannot open: Permission denied". NOT_FOUND,
// PERMISSION_DENIED, INVALID_ARGUMENT (a folder, a name too long), RESOURCE_EXHAUSTED (space, quota, memory,
// descriptors), else INTERNAL; never UNAVAILABLE, which says that a server cannot be reached.
[[nodiscard]] absl::Status FileError(int error_number, std::string_view what, const std::string& name);

}  // namespace tessera
