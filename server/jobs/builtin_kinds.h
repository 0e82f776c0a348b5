// Every job kind of this server.
#pragma once

#include <vector>

#include "server/jobs/job.h"

namespace tessera {

[[nodiscard]] std::vector<JobKind> BuiltinJobKinds();

}  // namespace tessera
