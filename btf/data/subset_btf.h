// A BTF without some of its views, lights or texels: what a codec is given when its errors on the rest are to
// be measured.
//
//   const std::vector<int> lights = KeptDirections(source.info().lights.size());
//   TESSERA_ASSIGN_OR_RETURN(auto kept, SubsetBtf::Create(source, {.lights = lights}));
//   TESSERA_ASSIGN_OR_RETURN(Material material, codec->Encode(*kept, params, context));
//   // errors at HeldOutDirections(source.info().lights.size())
//
// The rule: every fifth direction, indices 4, 9, 14, .. in the source's order, is held out, and whole: a
// light with all its views, or, separately, a view with all its lights; never single pairs, whose neighbours
// would give them away.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/data/btf_source.h"

namespace tessera {

inline constexpr int kHeldOutStride = 5;

// Indices below `count` that the rule holds out, and the others; both ascending. None of fewer than five.
[[nodiscard]] std::vector<int> HeldOutDirections(size_t count);
[[nodiscard]] std::vector<int> KeptDirections(size_t count);

// What is kept. Ascending indices into the source's; empty keeps all.
struct BtfSubset {
  std::vector<int> views;
  std::vector<int> lights;
  std::vector<int> columns;
  std::vector<int> rows;
};

// Reads what it needs of the source, whole rows, at most kSubsetBlockBytes of them at a time (but one row).
// Borrows the source, which must outlive it. Not thread-safe, as the source is not.
inline constexpr size_t kSubsetBlockBytes = size_t{32} << 20;

class SubsetBtf final : public BtfSource {
 public:
  // Errors: INVALID_ARGUMENT naming the index that is out of range or not above the one before.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<SubsetBtf>> Create(BtfSource& source,
                                                                         const BtfSubset& subset);

  [[nodiscard]] const BtfInfo& info() const override { return info_; }
  [[nodiscard]] absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                      const RunContext& context) override;

 private:
  SubsetBtf(BtfSource& source, BtfSubset subset);
  // One row of the source, to one of ours.
  void Gather(std::span<const float> source_row, std::span<float> row) const;

  BtfSource& source_;
  BtfSubset subset_;  // filled: nothing empty
  BtfInfo info_;
};

}  // namespace tessera
