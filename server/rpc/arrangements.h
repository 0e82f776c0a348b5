// The service tessera.v1.Arrangements: the built-in arrangements.
#pragma once

#include <absl/status/statusor.h>

#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Each function is the RPC of its name. Thread-safe.
class ArrangementsService {
 public:
  [[nodiscard]] absl::StatusOr<v1::Arrangement> GetArrangement(
      const v1::GetArrangementRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::ListArrangementsResponse> ListArrangements(
      const v1::ListArrangementsRequest& request) const;
};

}  // namespace tessera
