// What a job kind is: a function from parameters and input blobs to an output blob and its description. It
// sees neither catalog nor RPC, so that its worker can later be another process or machine.
//
//   absl::StatusOr<JobOutput> RunImportJob(const JobInput& input, const JobContext& context);
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Largest container that is parsed in memory.
inline constexpr uint64_t kMaxContainerBytes = uint64_t{4} << 30;

// Where a job reads its inputs. Thread-safe.
class BlobReader {
 public:
  virtual ~BlobReader() = default;
  // Errors: NOT_FOUND, DATA_LOSS, RESOURCE_EXHAUSTED above `limit_bytes`.
  [[nodiscard]] virtual absl::StatusOr<std::string> ReadAll(std::string_view sha256,
                                                            uint64_t limit_bytes) const = 0;
  // Writes the blob to a new file. Errors: as above, storage errors.
  [[nodiscard]] virtual absl::Status CopyTo(std::string_view sha256,
                                            const std::filesystem::path& file) const = 0;
};

struct JobInput {
  std::string params;               // serialized message of the kind
  std::vector<std::string> inputs;  // SHA-256 of blobs, in the kind's order
};

struct JobContext {
  RunContext run;
  const BlobReader* blobs = nullptr;
  std::filesystem::path scratch_folder;  // empty at first, gone afterwards
};

struct JobOutput {
  std::string blob;  // bytes of a container, or of a picture
  // What the catalog tells of it; name, blob and create_time are not set. Of a thumbnail: an empty TileSet.
  std::variant<v1::Material, v1::TileSet> resource;
};

using JobFunction =
    std::function<absl::StatusOr<JobOutput>(const JobInput& input, const JobContext& context)>;

// The kind of which the pool queues a job for each new tile set. Its one input is the tile set.
inline constexpr std::string_view kThumbnailKind = "thumbnail";

struct JobKind {
  std::string name;
  int version = 1;  // part of the identity of work: raise it when results change
  JobFunction run;
  // Its last input is what the name of its result holds: the job fails where the name holds something else by
  // the time it ends. A tile set keeps its thumbnail, so its tiles must stay.
  bool updates_result = false;
};

}  // namespace tessera
