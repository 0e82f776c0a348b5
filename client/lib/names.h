// Resource names, short as people type them and full as the service takes them.
//
//   "wool"             <->  "materials/wool"
//   "surface-96/wool"  <->  "arrangements/surface-96/tileSets/wool"
//   "17"               <->  "jobs/17"
#pragma once

#include <string>
#include <string_view>

#include <absl/status/statusor.h>

namespace tessera {

// Full names are accepted as they are. Errors: INVALID_ARGUMENT with reason NAME_INVALID, quoting the name
// and the legal form.
[[nodiscard]] absl::StatusOr<std::string> FullMaterialName(std::string_view name);
[[nodiscard]] absl::StatusOr<std::string> FullArrangementName(std::string_view name);
[[nodiscard]] absl::StatusOr<std::string> FullTileSetName(std::string_view name);
[[nodiscard]] absl::StatusOr<std::string> FullJobName(std::string_view name);

// The short form of a full name; what is not a full name comes back unchanged.
[[nodiscard]] std::string ShortName(std::string_view full_name);

}  // namespace tessera
