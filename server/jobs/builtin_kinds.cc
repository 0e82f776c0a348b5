#include "server/jobs/builtin_kinds.h"

#include "server/jobs/certify_job.h"
#include "server/jobs/generate_job.h"
#include "server/jobs/import_job.h"
#include "server/jobs/synthesize_job.h"
#include "server/jobs/thumbnail_job.h"

namespace tessera {

std::vector<JobKind> BuiltinJobKinds() {
  return {
      {"import", 1, &RunImportJob},
      {"generate", 1, &RunGenerateJob},
      {"synthesize", 2, &RunSynthesizeJob},
      {std::string(kCertifyKind), 1, &RunCertifyJob, /*updates_result=*/true},
      {std::string(kThumbnailKind), 1, &RunThumbnailJob},
  };
}

}  // namespace tessera
