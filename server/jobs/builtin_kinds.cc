#include "server/jobs/builtin_kinds.h"

#include "server/jobs/certify_job.h"
#include "server/jobs/generate_job.h"
#include "server/jobs/import_job.h"
#include "server/jobs/synthesize_job.h"
#include "server/jobs/thumbnail_job.h"

namespace tessera {

std::vector<JobKind> BuiltinJobKinds() {
  return {
      {"import", 2, &RunImportJob},
      {"generate", 2, &RunGenerateJob},
      {"synthesize", 3, &RunSynthesizeJob},
      {std::string(kCertifyKind), 2, &RunCertifyJob, /*updates_result=*/true},
      {std::string(kThumbnailKind), 2, &RunThumbnailJob},
  };
}

}  // namespace tessera
