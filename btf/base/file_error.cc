#include "btf/base/file_error.h"

#include <cerrno>
#include <system_error>

#include <absl/strings/str_cat.h>

namespace tessera {

absl::Status FileError(int error_number, std::string_view what, const std::string& name) {
  const std::string message = absl::StrCat(name, ": ", absl::string_view(what.data(), what.size()), ": ",
                                           std::generic_category().message(error_number));
  switch (error_number) {
    case ENOENT:
    case ENOTDIR:
      return absl::NotFoundError(message);
    case EACCES:
    case EPERM:
    case EROFS:
      return absl::PermissionDeniedError(message);
    case EISDIR:
    case ENAMETOOLONG:
      return absl::InvalidArgumentError(message);
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
    case EMFILE:
    case ENFILE:
    case ENOMEM:
      return absl::ResourceExhaustedError(message);
    default:
      return absl::InternalError(message);
  }
}

}  // namespace tessera
