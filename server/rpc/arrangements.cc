#include "server/rpc/arrangements.h"

#include "btf/base/status_macros.h"
#include "btf/wang/arrangement.h"
#include "proto/wire/convert.h"
#include "proto/wire/names.h"

namespace tessera {

absl::StatusOr<v1::Arrangement> ArrangementsService::GetArrangement(
    const v1::GetArrangementRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const std::string id, ParseArrangementName(request.name()));
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement(id));
  return MessageFromArrangement(*arrangement);
}

absl::StatusOr<v1::ListArrangementsResponse> ArrangementsService::ListArrangements(
    const v1::ListArrangementsRequest&) const {
  v1::ListArrangementsResponse response;
  for (const Arrangement& arrangement : BuiltinArrangements()) {
    *response.add_arrangements() = MessageFromArrangement(arrangement);
  }
  return response;
}

}  // namespace tessera
