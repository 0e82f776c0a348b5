// Tables of a codec by views and lights as cores (wang/table_cores.h): bases by higher-order singular value
// decomposition [De Lathauwer et al. 2000] of all matrices, each by what an error in it costs.
//
//   TESSERA_ASSIGN_OR_RETURN(std::optional<CoreCoder> coder, CoreCoder::Create(table, costs));
//   std::vector<int32_t> codes = coder->Finer(/*step=*/0.01F);    // coder->sum() has them
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/codec/btfel_table.h"
#include "btf/wang/table_cores.h"

namespace tessera {

// The whole number of steps nearest to a value, but 0 up to a tenth of a step beyond one half: small codes
// cost more than they save.
[[nodiscard]] int32_t CodeOf(double value, double step);

class CoreCoder {
 public:
  // `costs` [matrices]: the RMSE in reflectance that one step of a matrix's numbers makes. Errors: CoreSum's.
  [[nodiscard]] static absl::StatusOr<CoreCoder> Create(const BtfelTable& table,
                                                        std::vector<AngularTable> tables,
                                                        const std::vector<double>& costs);

  // What makes the cores as fine as `step`, in reflectance, up to the last code that is not 0; added to
  // sum().
  [[nodiscard]] std::vector<int32_t> Finer(float step);
  [[nodiscard]] const CoreSum& sum() const { return sum_; }
  [[nodiscard]] const CoreBases& bases() const { return bases_; }

 private:
  CoreCoder(CoreSum sum, CoreBases bases) : sum_(std::move(sum)), bases_(std::move(bases)) {}

  CoreSum sum_;
  CoreBases bases_;
  std::vector<float> wanted_;  // [position][matrix]
};

}  // namespace tessera
