// The codes of a BTFel table: bytes in memory, or, where they would be too many for it, in a spill file that
// is mapped into the address space. Either way they are read and written as those of a std::vector<uint8_t>.
//
//   TESSERA_ASSIGN_OR_RETURN(table.codes, CodeBuffer::Create(num_codes, budget_bytes / 4, spill_folder));
//   Quantize(.., std::span(table.codes).subspan(begin, count));   // block by block
//   table.codes.DropPages();                                      // after each
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/spill_file.h"

namespace tessera {

// A copy lies in memory. As thread-safe as a vector.
class CodeBuffer {
 public:
  using value_type = uint8_t;
  using iterator = uint8_t*;
  using const_iterator = const uint8_t*;

  CodeBuffer() = default;
  CodeBuffer(std::vector<uint8_t> codes)  // NOLINT(google-explicit-constructor)
      : memory_(std::move(codes)), view_(memory_) {}
  CodeBuffer(const CodeBuffer& other) : CodeBuffer(std::vector<uint8_t>(other.begin(), other.end())) {}
  CodeBuffer(CodeBuffer&& other) noexcept;
  CodeBuffer& operator=(CodeBuffer other) noexcept;

  // `size` zeros: in memory up to `memory_limit_bytes`, in a SpillFile in `folder` beyond it, its space
  // reserved, so that writing through the mapping meets no full disk. Errors: SpillFile::Create's.
  [[nodiscard]] static absl::StatusOr<CodeBuffer> Create(uint64_t size, uint64_t memory_limit_bytes,
                                                         const std::filesystem::path& folder = {});

  [[nodiscard]] bool is_spilled() const { return spilled_ != nullptr; }
  // Lets the system take back the memory of a spilled buffer's pages; touched again, they come back from the
  // file. Nothing happens to a buffer in memory.
  void DropPages() const {
    if (spilled_ != nullptr) {
      spilled_->DropPages();
    }
  }
  // Copies codes [offset, offset + codes.size()), of a spilled buffer straight from the file: no page of the
  // mapping is touched. Errors: SpillFile::Read's.
  [[nodiscard]] absl::Status Read(uint64_t offset, std::span<uint8_t> codes) const;

  [[nodiscard]] const uint8_t* data() const { return view_.data(); }
  [[nodiscard]] uint8_t* data() { return view_.data(); }
  [[nodiscard]] size_t size() const { return view_.size(); }
  [[nodiscard]] bool empty() const { return view_.empty(); }
  [[nodiscard]] const uint8_t* begin() const { return data(); }
  [[nodiscard]] const uint8_t* end() const { return data() + size(); }
  [[nodiscard]] uint8_t* begin() { return data(); }
  [[nodiscard]] uint8_t* end() { return data() + size(); }
  [[nodiscard]] uint8_t operator[](size_t index) const { return view_[index]; }
  [[nodiscard]] uint8_t& operator[](size_t index) { return view_[index]; }
  friend bool operator==(const CodeBuffer& a, const CodeBuffer& b);

  // Those of std::vector. They change the size, so the codes of a spilled buffer move to memory first.
  void resize(size_t size) {
    Vector().resize(size);
    view_ = memory_;
  }
  void push_back(uint8_t code) {
    Vector().push_back(code);
    view_ = memory_;
  }
  void pop_back() {
    Vector().pop_back();
    view_ = memory_;
  }
  void assign(size_t size, uint8_t code) { *this = CodeBuffer(std::vector<uint8_t>(size, code)); }
  template <typename Iterator>
  void insert(const uint8_t* position, Iterator first, Iterator last) {
    const ptrdiff_t index = position - begin();
    std::vector<uint8_t>& codes = Vector();
    codes.insert(codes.begin() + index, first, last);
    view_ = memory_;
  }

 private:
  std::vector<uint8_t>& Vector();

  std::vector<uint8_t> memory_;
  std::unique_ptr<SpillFile> spilled_;
  std::span<uint8_t> view_;  // of either
};

}  // namespace tessera
