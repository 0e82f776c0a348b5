// Where an encoder keeps its float coefficients until their range is known: in memory while a budget allows
// it, else in a temporary file that has no name and vanishes with the object.
//
//   TESSERA_ASSIGN_OR_RETURN(auto store, CoefficientStore::Create(num_values, budget_bytes));
//   std::span<float> block = store->BeginWrite(begin, count);  // fill it, then
//   TESSERA_RETURN_IF_ERROR(store->EndWrite());
//   TESSERA_ASSIGN_OR_RETURN(std::span<const float> values, store->Read(begin, count));
#pragma once

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace tessera {

struct FreeDeleter {
  void operator()(float* memory) const { std::free(memory); }
};

// Not thread-safe; the span of a block may be filled by many threads.
class CoefficientStore {
 public:
  // For `num_values` floats. Errors: RESOURCE_EXHAUSTED when they exceed the budget and the temporary folder
  // has no room for them, checked before anything is written; UNAVAILABLE when no file can be made there.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<CoefficientStore>> Create(uint64_t num_values,
                                                                                uint64_t budget_bytes);
  ~CoefficientStore();
  CoefficientStore(const CoefficientStore&) = delete;
  CoefficientStore& operator=(const CoefficientStore&) = delete;

  [[nodiscard]] bool is_spilled() const { return file_ >= 0; }

  // Room for values [begin, begin + count), valid until the next call.
  [[nodiscard]] std::span<float> BeginWrite(uint64_t begin, uint64_t count);
  // Errors: RESOURCE_EXHAUSTED (the file system is full), UNAVAILABLE (it fails otherwise).
  [[nodiscard]] absl::Status EndWrite();
  // The values written there; the span is valid until the next call. Errors: UNAVAILABLE.
  [[nodiscard]] absl::StatusOr<std::span<const float>> Read(uint64_t begin, uint64_t count);

 private:
  CoefficientStore() = default;

  // Not zeroed: the threads that fill it also fault its pages in.
  std::span<float> Resize(uint64_t count);

  int file_ = -1;
  std::unique_ptr<float[], FreeDeleter> values_;  // all of them, or the block in use
  uint64_t num_values_ = 0;                       // in values_
  uint64_t block_begin_ = 0;
  uint64_t block_size_ = 0;
};

}  // namespace tessera
