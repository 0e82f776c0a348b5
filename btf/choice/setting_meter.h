// How far off a setting of a codec is on held-out directions, fast enough to try dozens of them.
//
//   TESSERA_ASSIGN_OR_RETURN(auto meter, SettingMeter::Create(source, params, context));
//   TESSERA_ASSIGN_OR_RETURN(SettingFigures figures, meter->Measure("dsh", setting));
//
// Errors are taken at the probe: the texels of up to kProbeRows rows and kProbeColumns columns, golden-ratio
// steps apart, so that no weave falls in with them. dsh* and view-pca are encoded from the probe alone. dfmf,
// whose angular factors are common to all texels, is encoded from up to kFitTexels of them (golden-ratio
// steps likewise, the probe included) at rank 64 and, beyond that, at rank 256: smaller models are the first
// components of a larger one (dfmf_prefix.h).
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/choice/dfmf_prefix.h"
#include "btf/choice/ladder.h"
#include "btf/choice/ladder_search.h"
#include "btf/codec/material.h"
#include "btf/data/memory_btf.h"
#include "btf/data/subset_btf.h"
#include "btf/measure/held_out.h"

namespace tessera {

inline constexpr int kProbeRows = 20;
inline constexpr int kProbeColumns = 20;
inline constexpr int64_t kFitTexels = int64_t{128} * 128;

// What choice and diagnosis add to a container's header, about.
inline constexpr uint64_t kRecordBytes = 3072;

// Not thread-safe. Borrows the source and the context.
class SettingMeter {
 public:
  // Reads the probe's rows. `params` gives the memory budget, of which the probe takes at most an eighth, and
  // the spill folder. Errors: FAILED_PRECONDITION when there are fewer than five views and fewer than five
  // lights; CANCELLED; the source's.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<SettingMeter>> Create(BtfSource& source,
                                                                            const EncodeParams& params,
                                                                            const RunContext& context);

  // Errors from a part of the texels, bytes of a container of all of them. Reports "choose", "settings".
  // Errors: Codec::Encode's.
  [[nodiscard]] absl::StatusOr<SettingFigures> Measure(const std::string& codec, const Setting& setting);
  // The same, encoded from all texels. Errors: as above.
  [[nodiscard]] absl::StatusOr<SettingFigures> MeasureWhole(const std::string& codec, const Setting& setting);
  // RMSE of a finished material of the source at the directions that it was encoded from, at the probe.
  [[nodiscard]] absl::StatusOr<double> SampledError(const Material& material) const;

 private:
  SettingMeter(BtfSource& source, const EncodeParams& params, const RunContext& context);
  [[nodiscard]] absl::Status ReadProbe();
  // An encoding of `texels` (rows and columns of `source`) without what the split holds out.
  [[nodiscard]] absl::StatusOr<Material> EncodeKept(BtfSource& source, const BtfSubset& texels, Split split,
                                                    const std::string& codec,
                                                    const EncodeParams& params) const;
  // RMSE of a table of the probe's texels, where the split takes it.
  [[nodiscard]] absl::StatusOr<double> ErrorOf(BtfelTable table, Split split) const;
  // Fills the errors of the splits that exist; `error` gives one.
  [[nodiscard]] absl::Status AddErrors(SettingFigures& figures,
                                       const std::function<absl::StatusOr<double>(Split)>& error) const;
  [[nodiscard]] absl::StatusOr<SettingFigures> MeasureDfmf(const Setting& setting);
  // The factorisation of that rank without what the split holds out; made once.
  [[nodiscard]] absl::StatusOr<const Material*> Factorisation(Split split, int rank);
  // Bytes and cost of decoding of a material of all texels and directions, from one of one texel.
  [[nodiscard]] absl::StatusOr<SettingFigures> CostOf(Material one_texel) const;
  [[nodiscard]] absl::StatusOr<SettingFigures> CostOfDfmf(const Material& kept, const DfmfRanks& ranks) const;

  BtfSource& source_;
  EncodeParams params_;
  const RunContext& context_;
  RunContext quiet_;
  uint64_t num_measured_ = 0;
  std::unique_ptr<MemoryBtf> probe_;  // in one row
  std::vector<size_t> probe_texels_;  // in the source
  BtfSubset fit_;                     // rows and columns
  std::vector<size_t> probe_in_fit_;  // the same texels there
  std::map<std::pair<Split, int>, Material> factorisations_;
};

}  // namespace tessera
